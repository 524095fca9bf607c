"""The files of a package: archives that are refused, and what is extracted."""

import zipfile
from pathlib import Path

import pytest

from falsifier.errors import SpecError
from falsifier.fmu import read_package
from falsifier.fmu.description import archive
from falsifier.fmu.ssp.package import Package
from tests.fmu.packages import PLANT, structure, system, write


def test_a_file_is_extracted_once_and_keeps_its_name(tmp_path: Path) -> None:
    file = write(tmp_path / "a.ssp", structure(system(PLANT)), "Plant_2")
    package = Package(file, "a.ssp")
    found = package.file("resources/Plant_2.fmu")
    assert found.name == "Plant_2.fmu" and found == package.file("resources/Plant%5F2.fmu")
    assert b"SystemStructureDescription" in package.structure()


@pytest.mark.parametrize("name", ["gone.ssp", "gone.ssd"])
def test_what_is_not_there_is_said(name: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"gone\.ss.: no such file; give the path of an \.ssp or \.ssd file"):
        read_package(tmp_path / name)


def test_what_is_no_archive_or_has_no_description_is_said(tmp_path: Path) -> None:
    file = tmp_path / "a.ssp"
    file.write_bytes(b"no zip")
    with pytest.raises(SpecError, match=r"a\.ssp: not a readable SSP package, which is a zip archive"):
        read_package(file)
    with zipfile.ZipFile(file, "w") as package:
        package.writestr("readme.txt", "")
    with pytest.raises(SpecError, match=r"a\.ssp: the package contains no SystemStructure\.ssd"):
        read_package(file)


def test_a_zip_bomb_is_rejected_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "_DENSE_FROM_BYTES", 1 << 20)
    file = tmp_path / "bomb.ssp"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("SystemStructure.ssd", structure(system(PLANT)))
        package.writestr("resources/Plant_2.fmu", bytes(2 << 20))
    with pytest.raises(SpecError, match=r"bomb\.ssp: rejected because .* like a zip bomb"):
        read_package(file)


def test_a_name_that_is_too_long_is_missing(tmp_path: Path) -> None:
    (tmp_path / "a.ssd").write_text(structure(system(PLANT.replace("resources/", "x" * 300))))
    with pytest.raises(SpecError, match=r"a\.ssd: the resource 'x+Plant_2\.fmu' is missing"):
        read_package(tmp_path / "a.ssd")
