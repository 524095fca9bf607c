from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu.opening import open_session, unpack
from falsifier.fmu.session import Session
from falsifier.fmu.systems.system import _order
from tests.fmu.small_systems import loop, system


def test_each_component_gets_a_folder_of_its_own_and_is_announced(tmp_path: Path) -> None:
    twice = system({"b": "Gain_2", "a": "Plant_2", "c": "Plant_2"}, {"b.measured": "a.y"})
    order = _order(twice, logging=False)
    unpack(order, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0", "1", "2"]
    libraries = [next((tmp_path / k).rglob("Plant.so")) for k in "12"]
    assert libraries[0].stat().st_ino != libraries[1].stat().st_ino, "static data would be shared"
    announced: list[int] = []
    session = open_session(order, tmp_path, lambda _: None, announced.append)
    assert isinstance(session, Session)
    assert announced == [1, 0, 2], "positions in the order of stepping a, b, c"
    session.close()


def test_a_component_without_a_library_is_named(tmp_path: Path) -> None:
    order = _order(loop(), logging=False)
    unpack(order, tmp_path)
    next((tmp_path / "1").rglob("Gain.so")).unlink()
    with pytest.raises(ModelError, match=r"^pi: "):
        open_session(order, tmp_path, lambda _: None)
