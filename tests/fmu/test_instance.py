from pathlib import Path

import pytest

from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.instance import FmuInstance
from tests.fmu.fixtures import path


@pytest.mark.parametrize(("name", "saves"), [("Plant_2", True), ("Plant_3", True), ("Lag_2", False)])
def test_a_saved_state_is_taken_restored_and_forgotten_where_it_is_declared(
    name: str, saves: bool, tmp_path: Path
) -> None:
    archive.extract(path(name), tmp_path)
    one = FmuInstance(read_description(path(name)), tmp_path, "co-simulation", lambda _: None)
    assert one.saves_state == saves
    assert not one.is_taken and not one.restore()
    if saves:
        assert one.take() and one.is_taken and one.restore()
        one.forget()
        assert not one.is_taken
    one.renew()
    assert one.reset()
    one.close()
