"""What a Windows library needs, from made-up files and from real ones."""

import struct
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.fmu.description.binaries import read_pe
from tests.fmu.fixtures import FOLDER

START, ADDRESS, OFFSET = 0x80, 0x1000, 0x200


def windows_library(*needed: str, machine: int = 0x8664) -> bytes:
    """A library without code: one section, which contains what it imports."""
    directories = 112 if machine == 0x8664 else 96
    size = directories + 16 * 8
    names, entries = b"", b""
    first = ADDRESS + 20 * (len(needed) + 1)
    for name in needed:
        entries += struct.pack("<12xI4x", first + len(names))
        names += name.encode() + b"\0"
    section = entries + bytes(20) + names
    optional = bytearray(size)
    struct.pack_into("<H", optional, 0, 0x20B if machine == 0x8664 else 0x10B)
    struct.pack_into("<IIIII", optional, directories - 4, 16, 0, 0, ADDRESS if needed else 0, len(section))
    head = b"MZ".ljust(0x3C, b"\0") + struct.pack("<I", START)
    head = head.ljust(START, b"\0") + b"PE\0\0" + struct.pack("<HH12xHH", machine, 1, size, 0x2022)
    place = struct.pack("<8sIIII16x", b".idata", len(section), ADDRESS, len(section), OFFSET)
    return (head + optional + place).ljust(OFFSET, b"\0") + section


@pytest.mark.parametrize("machine", [0x8664, 0x14C])
@pytest.mark.parametrize("needed", [(), ("A.dll",), ("KERNEL32.dll", "b.dll")])
def test_what_is_needed_is_read(needed: tuple[str, ...], machine: int) -> None:
    found = read_pe(windows_library(*needed, machine=machine))
    assert found.needed == needed
    assert found.is_64 == (machine == 0x8664)


def test_a_real_library_needs_that_of_the_system() -> None:
    with zipfile.ZipFile(FOLDER / "win64" / "Lag_2.fmu") as archive:
        found = read_pe(archive.read("binaries/win64/Lag.dll"))
    assert found.is_64 and "KERNEL32.dll" in found.needed


@pytest.mark.parametrize("content", [b"", b"MZ", b"\x7fELF" + bytes(100), b"MZ" + bytes(200)])
def test_other_files_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match="Windows library"):
        read_pe(content)


@given(st.integers(0, 0x2FF), st.binary(min_size=1, max_size=8))
def test_damaged_files_are_read_or_refused(at: int, damage: bytes) -> None:
    content = bytearray(windows_library("KERNEL32.dll", "b.dll"))
    content[at : at + len(damage)] = damage
    for damaged in (bytes(content), bytes(content[:at])):
        try:
            assert isinstance(read_pe(damaged).needed, tuple)
        except ValueError as error:
            assert "Windows library" in str(error)
