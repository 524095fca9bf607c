import shutil
import zipfile
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.errors import ModelError
from falsifier.fmu import read_info
from falsifier.fmu.description import libraries
from tests.fixtures.archives import packed
from tests.fmu.fixtures import FOLDER, path

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="M" guid="g">
<CoSimulation modelIdentifier="M"/><ModelVariables/><ModelStructure/></fmiModelDescription>"""
LIBRARIES = {
    "x86_64": b"\x7fELF\2\1" + bytes(12) + b"\x3e\0",
    "aarch64": b"\x7fELF\2\1" + bytes(12) + b"\xb7\0",
    "x86": b"\x7fELF\1\1" + bytes(12) + b"\3\0",
    "windows": b"MZ".ljust(0x3C, b"\0") + b"\x80\0\0\0".ljust(0x44, b"\0") + b"PE\0\0\x64\x86",
    "windows x86": b"MZ".ljust(0x3C, b"\0") + b"\x80\0\0\0".ljust(0x44, b"\0") + b"PE\0\0\x4c\1",
    "nothing": b"",
}


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    monkeypatch.setattr("sys.platform", "linux")


def notes(folder: Path, *libraries: tuple[str, str], sources: bool = False) -> tuple[str, ...]:
    """What is said of an FMU with files below ``binaries`` and their content by its name."""
    contents: dict[str, str | bytes] = {"modelDescription.xml": DESCRIPTION}
    contents |= {f"binaries/{name}": LIBRARIES[content] for name, content in libraries}
    if sources:
        contents["sources/all.c"] = b""
    return read_info(packed(folder / "my.fmu", contents)).notes


def test_nothing_is_said_of_the_fmus_of_this_project() -> None:
    found = [*FOLDER.glob("Lag_?.fmu"), bundled("fmus") / "AT.fmu"]
    assert len(found) == 3
    assert [said for each in found for said in read_info(each).notes] == []


@pytest.mark.parametrize("content", LIBRARIES)
def test_a_file_that_is_for_another_processor_than_its_folder_is_named(tmp_path: Path, content: str) -> None:
    expected = "M.so is not a library for x86_64-linux; export the FMU again for it"
    assert notes(tmp_path, ("linux64/M.so", content)) == (() if content == "x86_64" else (expected,))
    expected = "M.dll is not a library for x86_64-windows; export the FMU again for it"
    said = notes(tmp_path, ("win64/M.dll", content))[1:]
    assert said == (() if content == "windows" else (expected,))


def test_binaries_for_other_systems_are_named_with_what_helps(tmp_path: Path) -> None:
    (said,) = notes(tmp_path, ("linux32/M.so", "x86"))
    assert said == (
        "no binary for x86_64-linux, only for x86-linux; a 32-bit binary cannot be loaded here; export it "
        "again for this platform (binaries/linux64/M.so is missing)"
    )
    (said,) = notes(tmp_path, ("darwin64\\M.dylib", "nothing"))  # as Windows knows the name
    assert "only for x86_64-darwin; binaries for macOS run only there" in said
    (said,) = notes(tmp_path, ("darwin64/M.dylib", "nothing"), sources=True)
    assert "it contains C sources: compile them with `falsifier tools build my.fmu`" in said


def test_a_windows_binary_that_runs_through_wine_is_not_called_missing(tmp_path: Path) -> None:
    (wine,) = notes(tmp_path, ("win64/M.dll", "windows"))
    assert wine.startswith("win64 only: runs through Wine")
    said = notes(tmp_path, ("win64/M.dll", "windows"), sources=True)
    assert said[0] == wine and said[1].startswith(
        "no binary for x86_64-linux, only for x86_64-windows; that for Windows runs through Wine; it "
        "contains C sources: compile them with `falsifier tools build my.fmu` to run without Wine"
    )


def test_a_damaged_binary_is_an_error(tmp_path: Path) -> None:
    copy = tmp_path / "copy.fmu"
    shutil.copy(path("Lag_2"), copy)
    with zipfile.ZipFile(copy) as archive:
        entry = archive.getinfo("binaries/linux64/Lag.so")
    content = bytearray(copy.read_bytes())
    start = entry.header_offset + 30 + len(entry.filename)
    content[start : start + 50] = b"\xff" * 50
    copy.write_bytes(content)
    with pytest.raises(ModelError, match=r"binaries/linux64/Lag\.so is damaged"):
        read_info(copy)


@pytest.mark.parametrize("character", ["\\", '"'])
def test_paths_that_windows_programs_cannot_open_are_refused(character: str) -> None:
    with pytest.raises(ModelError, match="set TMPDIR to another folder"):
        libraries.windows_path(Path(f"/tmp/a{character}b/x.dll"))
