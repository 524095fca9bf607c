import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.fmu.description.binaries import read_elf


def library(
    needed: tuple[str, ...] = (),
    runpath: str = "",
    required: tuple[tuple[str, str], ...] = (),
    *,
    bits: int = 64,
    defined: tuple[str, ...] = (),
) -> bytes:
    """A shared library without code: one segment that is loaded, and its dynamic section."""
    strings, places = b"\0", {}
    for text in dict.fromkeys((*needed, runpath, *(t for pair in required for t in pair), *defined)):
        places[text] = len(strings)
        strings += text.encode() + b"\0"
    base, head = 0x10000, 64 + 2 * 56
    asked = b"".join(
        struct.pack("<HHIII", 1, 1, places[file], 16, 0 if k == len(required) - 1 else 32)
        + struct.pack("<IHHII", 0, 0, 2, places[version], 0)
        for k, (file, version) in enumerate(required)
    )
    offered = b"".join(
        struct.pack("<HHHHIII", 1, 0, k, 1, 0, 20, 0 if k == len(defined) - 1 else 28)
        + struct.pack("<II", places[version], 0)
        for k, version in enumerate(defined)
    )
    entries = [(1, places[name]) for name in needed] + [(5, base + head)]
    entries += [(29, places[runpath])] if runpath else []
    entries += [(0x6FFFFFFE, base + head + len(strings))] if required else []
    entries += [(0x6FFFFFFC, base + head + len(strings) + len(asked))] if defined else []
    dynamic = b"".join(struct.pack("<QQ", *entry) for entry in (*entries, (0, 0)))
    body = strings + asked + offered
    at, length = head + len(body), len(dynamic)
    size = at + length
    segments = struct.pack("<IIQQQQQQ", 1, 4, 0, base, base, size, size, 1)
    segments += struct.pack("<IIQQQQQQ", 2, 4, at, base + at, base + at, length, length, 8)
    start = b"\x7fELF" + bytes([2 if bits == 64 else 1, 1, 1]) + bytes(9)
    rest = struct.pack("<HHIQQQIHHHHHH", 3, 62, 1, 0, 64, 0, 0, 64, 56, 2, 0, 0, 0)
    return (start + rest + segments).ljust(head, b"\0") + body + dynamic


def test_what_a_library_needs_and_defines_is_read() -> None:
    asked = (("libc.so.6", "GLIBC_2.38"), ("libm.so.6", "GLIBC_2.29"))
    needed = ("libc.so.6", "libm.so.6")
    found = read_elf(library(needed, "$ORIGIN:/opt/tool", asked, defined=("A_1", "A_2")))
    assert (found.bits, found.needed, found.required) == (64, needed, asked)
    assert found.folders == ("$ORIGIN", "/opt/tool")
    assert found.defined == {"A_1", "A_2"}


@pytest.mark.parametrize("content", [b"", b"MZ" + bytes(100), b"\x7fELF", b"\x7fELF\x02\x01" + b"\xff" * 100])
def test_other_files_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match="ELF file"):
        read_elf(content)


@given(st.integers(0, 400), st.binary(min_size=1, max_size=8))
def test_damage_is_an_error_or_gives_other_names(at: int, damage: bytes) -> None:
    content = bytearray(library(("libc.so.6",), "$ORIGIN", (("libc.so.6", "GLIBC_2.38"),), defined=("A_1",)))
    content[at : at + len(damage)] = damage
    try:
        read_elf(bytes(content))
    except ValueError as error:
        assert "ELF file" in str(error)
