import shutil
import sys
import zipfile
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.errors import ModelError
from falsifier.fmu.description import libraries, needed_libraries
from falsifier.fmu.description.libraries import can_run_windows
from falsifier.fmu.description.needed_libraries import binary_remarks
from tests.fmu.description.test_elf import library
from tests.fmu.description.test_pe import windows_library
from tests.fmu.fixtures import FOLDER, path

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads libraries of Linux")

DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="M" guid="g">
<CoSimulation modelIdentifier="M"/><ModelVariables/><ModelStructure/></fmiModelDescription>"""


def fmu(folder: Path, **files: bytes) -> Path:
    """An FMU with these files in its folder for 64-bit Linux, named with __ for a dot."""
    packed = folder / "my.fmu"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        for name, content in files.items():
            archive.writestr(f"binaries/linux64/{name.replace('__', '.')}", content)
    return packed


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "x86_64")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with these libraries only."""
    folder = tmp_path / "lib"
    folder.mkdir()
    for name, versions in {"libc.so.6": ("GLIBC_2.2.5", "GLIBC_2.34"), "libz.so.1": ()}.items():
        (folder / name).write_bytes(library(defined=versions))
    monkeypatch.setattr(needed_libraries, "_FOLDERS", (str(folder),))
    monkeypatch.setattr(needed_libraries, "_listed", lambda: {})
    monkeypatch.setattr("platform.libc_ver", lambda: ("glibc", "2.34"))
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    return folder


def test_all_fmus_of_this_project_can_be_loaded_here() -> None:
    found = [*FOLDER.glob("Lag_?.fmu"), bundled("fmus") / "AT.fmu"]
    assert len(found) == 3
    assert [said for each in found for said in binary_remarks(each)] == []


def test_a_library_that_is_not_installed_is_named(tmp_path: Path, installed: Path) -> None:
    given = fmu(tmp_path, M__so=library(("libc.so.6", "libz.so.1", "libtool_rt.so.9")))
    assert binary_remarks(given) == (
        "M.so needs libtool_rt.so.9, which is not installed on this machine; install it, or add its folder "
        "to LD_LIBRARY_PATH",
    )
    (installed / "libtool_rt.so.9").write_bytes(library())
    assert binary_remarks(given) == ()


def test_libraries_in_the_fmu_are_looked_up_where_it_looks_and_so_are_theirs(
    tmp_path: Path, installed: Path
) -> None:
    helper = library(("libgone.so",))
    found = binary_remarks(fmu(tmp_path, M__so=library(("libhelp.so",), "$ORIGIN"), libhelp__so=helper))
    assert [said.partition(",")[0] for said in found] == ["libhelp.so needs libgone.so"]
    (found_there,) = binary_remarks(fmu(tmp_path, M__so=library(("libhelp.so",)), libhelp__so=helper))
    assert "the FMU contains it, but its library does not look there" in found_there


def test_the_newest_version_that_the_machine_lacks_is_named(tmp_path: Path, installed: Path) -> None:
    asked = tuple(("libc.so.6", f"GLIBC_2.{k}") for k in ("2.5", 38, 4, 34))
    assert binary_remarks(fmu(tmp_path, M__so=library(("libc.so.6",), "", asked))) == (
        "M.so needs GLIBC_2.38 of libc.so.6, but this machine has GLIBC_2.34: use a newer system, or an "
        "FMU that was compiled on an older one",
    )
    other = library(("libz.so.1",), "", (("libz.so.1", "ZLIB_9"),))
    assert binary_remarks(fmu(tmp_path, M__so=other)) == (), "it has no versions"


def test_what_is_no_library_of_linux_is_said(tmp_path: Path, installed: Path) -> None:
    assert binary_remarks(fmu(tmp_path, M__so=b"MZ")) == (
        "M.so is not an ELF file; export the FMU again for this platform",
    )


def without_linux(tmp_path: Path, folder: str, *, sources: bool = False) -> str:
    packed = tmp_path / "my.fmu"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.writestr(f"binaries/{folder}/M.bin", b"")
        if sources:
            archive.writestr("sources/all.c", b"")
    (said,) = binary_remarks(packed)
    return said


def test_binaries_for_other_systems_are_named_with_what_helps(tmp_path: Path) -> None:
    assert without_linux(tmp_path, "linux32") == (
        "no binary for x86_64-linux, only for x86-linux; a 32-bit binary cannot be loaded here; export it "
        "again for this platform"
    )
    assert "only for x86_64-darwin; binaries for macOS run only there" in without_linux(tmp_path, "darwin64")
    said = without_linux(tmp_path, "win64", sources=True)
    assert "it contains C sources: compile them with `falsifier tools build my.fmu`" in said


def test_a_windows_binary_that_runs_through_wine_is_not_called_missing(tmp_path: Path) -> None:
    if not can_run_windows():
        pytest.skip("Windows libraries are not simulated on this machine, with or without Wine")
    packed = tmp_path / "my.fmu"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.writestr("binaries/win64/M.dll", windows_library())
    assert binary_remarks(packed) == ()
    with zipfile.ZipFile(packed, "a") as archive:
        archive.writestr("sources/all.c", b"")
    assert binary_remarks(packed) == (
        "no binary for x86_64-linux, only for x86_64-windows; that for Windows runs through Wine; it "
        "contains C sources: compile them with `falsifier tools build my.fmu` to run without Wine",
    )


def test_what_a_windows_library_needs_beside_wine_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("falsifier.fmu.description.archive.this_platform", lambda: "x86_64-linux")
    monkeypatch.setattr(needed_libraries, "wine_libraries", lambda: frozenset({"kernel32.dll"}))
    packed = tmp_path / "my.fmu"

    def said(**files: bytes) -> tuple[str, ...]:
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr("modelDescription.xml", DESCRIPTION)
            for name, content in files.items():
                archive.writestr(f"binaries/win64/{name}.dll", content)
        return binary_remarks(packed)

    usual = windows_library("KERNEL32.dll", "api-ms-win-crt-heap-l1-1-0.dll", "Beside.dll")
    assert said(M=usual, beside=windows_library("kernel32.DLL", "M.dll")) == ()
    (text,) = said(M=usual, beside=windows_library("Licence.dll"))
    assert text.startswith("beside.dll needs Licence.dll, which is neither beside it in the FMU nor part of")
    assert said(M=windows_library(machine=0x14C)) == (
        "M.dll is not for 64-bit Windows on x86, which is what Wine runs; export it again",
    )
    assert said(M=b"") == ("M.dll is not a Windows library; export the FMU again",)


def test_a_damaged_binary_is_an_error(tmp_path: Path) -> None:
    copy = tmp_path / "copy.fmu"
    shutil.copy(path("Lag_2"), copy)
    with zipfile.ZipFile(copy) as archive:
        entry = archive.getinfo("binaries/linux64/Lag.so")
    content = bytearray(copy.read_bytes())
    middle = entry.header_offset + 30 + len(entry.filename) + entry.compress_size // 2
    content[middle : middle + 50] = bytes(50)
    copy.write_bytes(content)
    with pytest.raises(ModelError, match="a binary is damaged"):
        binary_remarks(copy)


@pytest.mark.parametrize("character", ["\\", '"'])
def test_paths_that_windows_programs_cannot_open_are_refused(character: str) -> None:
    with pytest.raises(ModelError, match="set TMPDIR to another folder"):
        libraries.windows_path(Path(f"/tmp/a{character}b/x.dll"))
