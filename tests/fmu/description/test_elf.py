import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.fmu.description.elf import read_elf


def library(
    needed: tuple[str, ...] = (),
    runpath: str = "",
    required: tuple[tuple[str, str], ...] = (),
    *,
    bits: int = 64,
    order: str = "<",
    defined: tuple[str, ...] = (),
) -> bytes:
    """A shared library without code: one segment that is loaded, and its dynamic section."""
    strings, places = b"\0", {}
    for text in dict.fromkeys((*needed, runpath, *(t for pair in required for t in pair), *defined)):
        places[text] = len(strings)
        strings += text.encode() + b"\0"
    word, base = ("Q", 0x10000) if bits == 64 else ("I", 0x10000)
    head = 64 + 2 * 56
    asked = b"".join(
        struct.pack(order + "HHIII", 1, 1, places[file], 16, 0 if k == len(required) - 1 else 32)
        + struct.pack(order + "IHHII", 0, 0, 2, places[version], 0)
        for k, (file, version) in enumerate(required)
    )
    offered = b"".join(
        struct.pack(order + "HHHHIII", 1, 0, k, 1, 0, 20, 0 if k == len(defined) - 1 else 28)
        + struct.pack(order + "II", places[version], 0)
        for k, version in enumerate(defined)
    )
    entries = [(1, places[name]) for name in needed] + [(5, base + head)]
    entries += [(29, places[runpath])] if runpath else []
    entries += [(0x6FFFFFFE, base + head + len(strings))] if required else []
    entries += [(0x6FFFFFFC, base + head + len(strings) + len(asked))] if defined else []
    dynamic = b"".join(struct.pack(order + 2 * word, *entry) for entry in (*entries, (0, 0)))
    body = strings + asked + offered
    at, size = head + len(body), head + len(body) + len(dynamic)
    start = b"\x7fELF" + bytes([2 if bits == 64 else 1, 1 if order == "<" else 2, 1]) + bytes(9)
    if bits == 64:
        segments = struct.pack(order + "IIQQQQQQ", 1, 4, 0, base, base, size, size, 1)
        segments += struct.pack(
            order + "IIQQQQQQ", 2, 4, at, base + at, base + at, len(dynamic), len(dynamic), 8
        )
        rest = struct.pack(order + "HHIQQQIHHHHHH", 3, 62, 1, 0, 64, 0, 0, 64, 56, 2, 0, 0, 0)
    else:
        segments = struct.pack(order + "IIIIIIII", 1, 0, base, base, size, size, 4, 1)
        segments += struct.pack(
            order + "IIIIIIII", 2, at, base + at, base + at, len(dynamic), len(dynamic), 4, 4
        )
        rest = struct.pack(order + "HHIIIIIHHHHHH", 3, 3, 1, 0, 52, 0, 0, 52, 32, 2, 0, 0, 0)
    return (start + rest + segments).ljust(head, b"\0") + body + dynamic


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("order", ["<", ">"])
def test_what_a_library_needs_and_defines_is_read(bits: int, order: str) -> None:
    asked = (("libc.so.6", "GLIBC_2.38"), ("libm.so.6", "GLIBC_2.29"))
    found = read_elf(
        library(
            ("libc.so.6", "libm.so.6"),
            "$ORIGIN:/opt/tool",
            asked,
            bits=bits,
            order=order,
            defined=("A_1", "A_2"),
        )
    )
    assert found.bits == bits
    assert found.needed == ("libc.so.6", "libm.so.6")
    assert found.folders == ("$ORIGIN", "/opt/tool")
    assert found.required == asked
    assert found.defined == {"A_1", "A_2"}


def test_a_real_library_is_read() -> None:
    import _ctypes

    file = getattr(_ctypes, "__file__", "")
    if not file.endswith(".so"):
        pytest.skip("it is not a shared library of Linux")
    assert any(name.startswith("libc.") for name in read_elf(Path(file).read_bytes()).needed)


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
