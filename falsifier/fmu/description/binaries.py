"""What a shared library says of itself, read from its file without loading it: ELF of Linux, PE of Windows.

Names and numbers are those of the System V ABI, of the Linux Standard Base, and of Microsoft's "PE Format".
All machines with processes of 64 bits that FMUs are built for have the least significant byte first.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

_ELF_MAGIC, _LITTLE_ENDIAN, _ENTRY_BYTES = b"\x7fELF", 1, 16
_LOADED, _DYNAMIC = 1, 2  # PT_LOAD, PT_DYNAMIC
_NEEDED, _STRINGS, _RPATH, _RUNPATH = 1, 5, 15, 29  # DT_NEEDED, DT_STRTAB, DT_RPATH, DT_RUNPATH
_DEFINED, _REQUIRED = 0x6FFFFFFC, 0x6FFFFFFE  # DT_VERDEF, DT_VERNEED
# Limits of what is read from a damaged file; real ones stay far below.
_MOST_ENTRIES, _LONGEST_NAME = 10_000, 4096
_PLACE = 0x3C  # where the file says where its header starts
_PE_MAGIC = b"PE\0\0"
_X86_64 = 0x8664
_PE32_PLUS = 0x20B
_HEADER, _SECTION, _IMPORT = 24, 40, 20  # bytes


@dataclass(frozen=True, slots=True)
class Elf:
    """Contents of an ELF file.

    Attributes:
        bits: 32 or 64; of a file with 32 bits nothing else is read.
        needed: file names of the libraries that are loaded with it.
        folders: where these are looked up first; ``$ORIGIN`` is the folder of the file.
        required: versions that it needs, each with the file name of the library that defines it.
        defined: versions that it defines.
    """

    bits: int
    needed: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    required: tuple[tuple[str, str], ...] = ()
    defined: frozenset[str] = frozenset()


def read_elf(content: bytes) -> Elf:
    """Read an ELF file.

    Raises:
        ValueError: if it is not one, or is damaged.
    """
    if (
        content[:4] != _ELF_MAGIC
        or len(content) < 64
        or content[4] not in (1, 2)
        or content[5] != _LITTLE_ENDIAN
    ):
        raise ValueError("not an ELF file")
    if content[4] == 1:
        return Elf(32)
    try:
        return _File(content).read()
    except (struct.error, IndexError, OverflowError) as error:
        raise ValueError(f"a damaged ELF file ({error})") from error


class _File:
    def __init__(self, content: bytes) -> None:
        self._content = content
        self._segments = list(self._read_segments())

    def read(self) -> Elf:
        entries = list(self._entries())
        first = dict(reversed(entries))
        strings = self._offset(first.get(_STRINGS, 0)) if _STRINGS in first else 0
        names = {
            tag: [self._name(strings, v) for t, v in entries if t == tag]
            for tag in (_NEEDED, _RPATH, _RUNPATH)
        }
        # A RUNPATH replaces the RPATH.
        paths = names[_RUNPATH] or names[_RPATH]
        return Elf(
            bits=64,
            needed=tuple(names[_NEEDED]),
            folders=tuple(folder for path in paths for folder in path.split(":") if folder),
            required=tuple(self._required(strings, first.get(_REQUIRED))),
            defined=frozenset(self._defined(strings, first.get(_DEFINED))),
        )

    def _unpack(self, kinds: str, offset: int) -> tuple[int, ...]:
        if offset < 0:
            raise IndexError("a position before the file")
        return struct.unpack_from(f"<{kinds}", self._content, offset)

    def _read_segments(self) -> Iterator[tuple[int, int, int, int]]:
        """Kind, position in the file, address and size in the file of each segment."""
        (start,) = self._unpack("Q", 32)
        size, count = self._unpack("HH", 54)
        for k in range(count):
            kind, _, offset, address, _, length = self._unpack("IIQQQQ", start + k * size)
            yield kind, offset, address, length

    def _entries(self) -> Iterator[tuple[int, int]]:
        """Tags and values of the dynamic section."""
        for kind, offset, _, length in self._segments:
            if kind == _DYNAMIC:
                for k in range(min(length // _ENTRY_BYTES, _MOST_ENTRIES)):
                    tag, value = self._unpack("QQ", offset + k * _ENTRY_BYTES)
                    if not tag:
                        return
                    yield tag, value

    def _offset(self, address: int) -> int:
        """Position in the file of an address."""
        for kind, offset, start, length in self._segments:
            if kind == _LOADED and start <= address < start + length:
                return offset + address - start
        raise IndexError("an address outside the file")

    def _name(self, strings: int, at: int) -> str:
        text = self._content[strings + at : strings + at + _LONGEST_NAME]
        return text.partition(b"\0")[0].decode("utf-8", "replace")

    def _required(self, strings: int, address: int | None) -> Iterator[tuple[str, str]]:
        """Version names of the chain of Verneed records with those of the Vernaux chain of each."""
        for at in self._chain(address, "HHIII", 4):
            _, count, file, first, _ = self._unpack("HHIII", at)
            inner = at + first
            for _ in range(count):
                *_, name, following = self._unpack("IHHII", inner)
                yield self._name(strings, file), self._name(strings, name)
                inner += following

    def _defined(self, strings: int, address: int | None) -> Iterator[str]:
        """Version names of the chain of Verdef records."""
        for at in self._chain(address, "HHHHIII", 6):
            first = self._unpack("HHHHIII", at)[5]
            yield self._name(strings, self._unpack("I", at + first)[0])

    def _chain(self, address: int | None, kinds: str, following: int) -> Iterator[int]:
        """Positions of records, each of which contains the distance to the next."""
        if address is None:
            return
        at = self._offset(address)
        for _ in range(_MOST_ENTRIES):
            yield at
            distance = self._unpack(kinds, at)[following]
            if not distance:
                return
            at += distance


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
        return _pe_of(content)
    except (struct.error, IndexError, OverflowError) as error:
        raise ValueError(f"a damaged Windows library ({error})") from error


def _pe_of(content: bytes) -> Pe:
    if content[:2] != b"MZ":
        raise ValueError("not a Windows library")
    (start,) = struct.unpack_from("<I", content, _PLACE)
    if content[start : start + 4] != _PE_MAGIC:
        raise ValueError("not a Windows library")
    machine, sections, size = struct.unpack_from("<HH12xH", content, start + 4)
    optional = start + _HEADER
    (kind,) = struct.unpack_from("<H", content, optional)
    # The first directory is that of the exports, the second that of the imports.
    directories = optional + (112 if kind == _PE32_PLUS else 96)
    count, _, _, address = struct.unpack_from("<IIII", content, directories - 4)
    places = [struct.unpack_from("<8xIIII", content, optional + size + k * _SECTION) for k in range(sections)]
    needed = _imported(content, places, address) if count > 1 and address else ()
    return Pe(machine == _X86_64, tuple(needed))


def _imported(content: bytes, sections: list[tuple[int, ...]], address: int) -> Iterator[str]:
    at = _position(sections, address)
    for k in range(_MOST_ENTRIES):
        (name,) = struct.unpack_from("<12xI4x", content, at + k * _IMPORT)
        if not name:
            return
        start = _position(sections, name)
        end = content.find(b"\0", start, start + _LONGEST_NAME)
        if end < 0:
            raise IndexError("a name does not end")
        yield content[start:end].decode("utf-8", "replace")
    raise IndexError("its imports do not end")


def _position(sections: list[tuple[int, ...]], address: int) -> int:
    """Return where in the file an address in memory comes from."""
    for size, start, stored, offset in sections:
        if start <= address < start + max(size, stored):
            return offset + address - start
    raise IndexError("an address outside of all sections")
