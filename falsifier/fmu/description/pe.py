"""What a library for Windows says of itself, read from its file (PE) without loading it.

Names and numbers are those of Microsoft's "PE Format".
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

_PLACE = 0x3C  # where the file says where its header starts
_MAGIC = b"PE\0\0"
_X86_64 = 0x8664
_PE32_PLUS = 0x20B
_HEADER, _SECTION, _IMPORT = 24, 40, 20  # bytes
# Limits of what is read from a damaged file; real ones stay far below.
_MOST_ENTRIES, _LONGEST_NAME = 10_000, 4096


@dataclass(frozen=True, slots=True)
class Pe:
    """Contents of a PE file.

    Attributes:
        is_64: whether it is for 64-bit processes on x86.
        needed: file names of the libraries that are loaded with it.
    """

    is_64: bool
    needed: tuple[str, ...]


def read_pe(content: bytes) -> Pe:
    """Read a PE file.

    Raises:
        ValueError: if it is not one, or is damaged.
    """
    try:
        return _read(content)
    except (struct.error, IndexError, OverflowError) as error:
        raise ValueError(f"a damaged Windows library ({error})") from error


def _read(content: bytes) -> Pe:
    if content[:2] != b"MZ":
        raise ValueError("not a Windows library")
    (start,) = struct.unpack_from("<I", content, _PLACE)
    if content[start : start + 4] != _MAGIC:
        raise ValueError("not a Windows library")
    machine, sections, size = struct.unpack_from("<HH12xH", content, start + 4)
    optional = start + _HEADER
    (kind,) = struct.unpack_from("<H", content, optional)
    # The first directory is that of the exports, the second that of the imports.
    directories = optional + (112 if kind == _PE32_PLUS else 96)
    count, _, _, address = struct.unpack_from("<IIII", content, directories - 4)
    places = [struct.unpack_from("<8xIIII", content, optional + size + k * _SECTION) for k in range(sections)]
    needed = _needed(content, places, address) if count > 1 and address else ()
    return Pe(machine == _X86_64, tuple(needed))


def _needed(content: bytes, sections: list[tuple[int, ...]], address: int) -> Iterator[str]:
    at = _offset(sections, address)
    for k in range(_MOST_ENTRIES):
        (name,) = struct.unpack_from("<12xI4x", content, at + k * _IMPORT)
        if not name:
            return
        start = _offset(sections, name)
        end = content.find(b"\0", start, start + _LONGEST_NAME)
        if end < 0:
            raise IndexError("a name does not end")
        yield content[start:end].decode("utf-8", "replace")
    raise IndexError("its imports do not end")


def _offset(sections: list[tuple[int, ...]], address: int) -> int:
    """Return where in the file an address in memory comes from."""
    for size, start, stored, offset in sections:
        if start <= address < start + max(size, stored):
            return offset + address - start
    raise IndexError("an address outside of all sections")
