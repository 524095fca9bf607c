import zipfile
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu.description import archive
from falsifier.fmu.description.structure import Structure, read_structure
from tests.fmu.fixtures import path


def structure(file: Path) -> Structure:
    return read_structure(file, archive.file_hash(file))


@pytest.mark.parametrize("major", [2, 3])
def test_outputs_depend_on_the_inputs_that_the_fmu_lists(major: int) -> None:
    assert structure(path(f"Gain_{major}")).inputs_of == {"y": {"r", "measured"}}
    assert structure(path(f"Plant_{major}")).inputs_of == {"y": frozenset()}
    assert structure(path(f"Lag_{major}")).inputs_of == {}, "it does not say a word about its output"


def test_units_come_with_it() -> None:
    assert structure(path("Gain_2mm")).units["mm"].factor == 0.001


@pytest.mark.parametrize("wrong", ['index="99" dependencies="1"', 'index="3" dependencies="99"'])
def test_wrong_references_are_one_clear_error(wrong: str, tmp_path: Path) -> None:
    text = archive.read_entry(path("Gain_2"), "modelDescription.xml").decode()
    file = tmp_path / "wrong.fmu"
    with zipfile.ZipFile(file, "w") as changed:
        changed.writestr("modelDescription.xml", text.replace('index="3" dependencies="1 2"', wrong))
    with pytest.raises(ModelError, match=r"wrong\.fmu: units or dependencies .* do not follow the standard"):
        structure(file)
