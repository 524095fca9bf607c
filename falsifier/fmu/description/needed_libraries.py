"""What an FMU's binary needs from this machine, looked up without loading it: said before a run."""

import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path, PurePosixPath

from falsifier.errors import ModelError
from falsifier.fmu.description import archive
from falsifier.fmu.description.binaries import Elf, read_elf, read_pe
from falsifier.fmu.description.libraries import misnamed_text, missing_binary_text, wine_libraries
from falsifier.fmu.description.model_description import Description, read_description

# Larger libraries are not read.
_MOST_BYTES = 512 << 20
_FOLDERS = ("/lib64", "/usr/lib64", "/lib", "/usr/lib", "/usr/local/lib")
_ORIGIN = re.compile(r"\$(ORIGIN|\{ORIGIN\})")
_LISTING_SECONDS = 10.0
_BITS = 64 if sys.maxsize > 1 << 32 else 32


def binary_remarks(path: Path) -> tuple[str, ...]:
    """Return why an FMU's binary cannot be loaded on this machine, one sentence each; none if it can.

    That it runs through Wine is among the notes of its description; here only what prevents that, and what
    makes Wine superfluous.

    Raises:
        ModelError: if the file is not an FMU.
    """
    description = read_description(path)
    names = archive.entry_names(path)
    missing = [i for i in description.identifiers if i not in description.libraries]
    said = []
    if missing and len(missing) == len(description.identifiers):
        misnamed = misnamed_text(
            names, description.info.fmi_version, [description.identifiers[i] for i in missing]
        )
        has_sources = any(n.startswith("sources/") and n.endswith(".c") for n in names)
        wine = any(map(description.needs_wine, missing))
        if misnamed:
            said.append(misnamed)
        elif has_sources or not wine:
            platforms = description.info.platforms
            text = missing_binary_text(path.name, platforms, has_sources=has_sources, needs_wine=wine)
            said.append(text)
    try:
        with archive.open_archive(path) as packed:
            if archive.this_platform().endswith("-linux"):
                said += _missing_on_linux(packed, description)
            if any(map(description.needs_wine, missing)):
                said += _missing_in_wine(packed, description)
    except archive.UNREADABLE as error:
        raise ModelError(f"{path}: a binary is damaged ({error}); copy or export the FMU again") from error
    return tuple(dict.fromkeys(said))


def _missing_on_linux(packed: zipfile.ZipFile, description: Description) -> Iterator[str]:
    bundled = {PurePosixPath(name) for name in packed.namelist()}
    for library in dict.fromkeys(description.libraries.values()):
        yield from _Look(packed, bundled).missing(library)


def _missing_in_wine(packed: zipfile.ZipFile, description: Description) -> Iterator[str]:
    """Yield what the libraries for Windows need that is neither beside them nor part of Wine."""
    entries = [PurePosixPath(name) for name in packed.namelist()]
    for library in dict.fromkeys(description.windows_libraries.values()):
        beside = {entry.name.lower(): str(entry) for entry in entries if entry.parent == library.parent}
        yield from _lacking_in_wine(packed, library.name, beside)


def _lacking_in_wine(packed: zipfile.ZipFile, first: str, beside: Mapping[str, str]) -> Iterator[str]:
    offered = wine_libraries()
    looked_at, seen = [first.lower()], {first.lower()}
    for name in looked_at:
        entry = beside[name]
        if packed.getinfo(entry).file_size > _MOST_BYTES:
            continue
        own = PurePosixPath(entry).name
        try:
            library = read_pe(packed.read(entry))
        except ValueError as error:
            yield f"{own} is {error}; export the FMU again"
            continue
        if not library.is_64:
            yield f"{own} is not for 64-bit Windows on x86, which is what Wine runs; export it again"
            continue
        for needed in library.needed:
            found = needed.lower()
            if found in beside and found not in seen:
                looked_at.append(found)
                seen.add(found)
            if found not in beside and offered and found not in offered and not _is_api_set(found):
                yield (
                    f"{own} needs {needed}, which is neither beside it in the FMU nor part of Wine; export "
                    "the FMU with it"
                )


def _is_api_set(name: str) -> bool:
    """Whether a name stands for functions of several libraries of Windows, which Wine knows."""
    return name.startswith(("api-ms-win-", "ext-ms-"))


class _Look:
    """Looks up what a library needs, and what the libraries beside it in the FMU need."""

    def __init__(self, packed: zipfile.ZipFile, bundled: set[PurePosixPath]) -> None:
        self._packed, self._bundled = packed, bundled
        self._seen: set[PurePosixPath] = set()

    def missing(self, library: PurePosixPath) -> Iterator[str]:
        self._seen.add(library)
        if self._packed.getinfo(str(library)).file_size > _MOST_BYTES:
            return
        try:
            elf = read_elf(self._packed.read(str(library)))
        except ValueError as error:
            yield f"{library.name} is {error}; export the FMU again for this platform"
            return
        if elf.bits != _BITS:
            yield f"{library.name} has {elf.bits} bits and cannot be loaded here; export it for {_BITS} bits"
            return
        for name in elf.needed:
            inside = self._inside(name, elf, library)
            if inside is not None:
                if inside not in self._seen:
                    yield from self.missing(inside)
            elif _installed(name, elf) is None:
                yield self._not_found(name, library)
        yield from _missing_versions(elf, library)

    def _inside(self, name: str, elf: Elf, library: PurePosixPath) -> PurePosixPath | None:
        """Return the entry of the FMU that is loaded for a name: those looked up beside the library."""
        for folder in elf.folders:
            if _ORIGIN.search(folder):
                place = _ORIGIN.sub(str(library.parent), folder)
                found = PurePosixPath(os.path.normpath(f"{place}/{name}"))
                if found in self._bundled:
                    return found
        return None

    def _not_found(self, name: str, library: PurePosixPath) -> str:
        text = f"{library.name} needs {name}, which is not installed on this machine"
        if library.with_name(name) in self._bundled:
            return (
                f"{text}; the FMU contains it, but its library does not look there (it has no RPATH $ORIGIN)"
            )
        return f"{text}; install it, or add its folder to LD_LIBRARY_PATH"


def _missing_versions(elf: Elf, library: PurePosixPath) -> Iterator[str]:
    """Say which versions the installed libraries lack: the newest of each kind, such as GLIBC_2.38."""
    lacking: dict[tuple[str, str], str] = {}
    for name, version in elf.required:
        found = _installed(name, elf)
        defined = _defined(found) if found is not None else None
        kind = version.rpartition("_")[0]
        # A library without versions serves all.
        if defined and version not in defined:
            lacking[name, kind] = max(version, lacking.get((name, kind), version), key=_numbers)
    for (name, kind), version in lacking.items():
        has = platform.libc_ver()[1] if kind == "GLIBC" else ""
        here = f"this machine has {kind}_{has}" if has else "that of this machine is older"
        yield (
            f"{library.name} needs {version} of {name}, but {here}: use a newer system, or an FMU that was "
            "compiled on an older one"
        )


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version)))


def _installed(name: str, elf: Elf) -> Path | None:
    """Return the installed library that would be loaded for a name; None if there is none."""
    if "/" in name:
        return Path(name) if Path(name).is_file() else None
    given = [*elf.folders, *os.environ.get("LD_LIBRARY_PATH", "").split(":")]
    places = [Path(folder) / name for folder in given if folder.startswith("/")]
    places += [*_listed().get(name, ()), *(Path(folder) / name for folder in _FOLDERS)]
    return next((place for place in places if _fits(place)), None)


def _fits(place: Path) -> bool:
    """Whether a file is a library for processes like this one, of 32 or 64 bits."""
    try:
        with place.open("rb") as file:
            start = file.read(5)
    except OSError:
        return False
    return start[:4] == b"\x7fELF" and start[4:] == (b"\2" if _BITS == 64 else b"\1")


@lru_cache(maxsize=1)
def _listed() -> Mapping[str, Sequence[Path]]:
    """Return the libraries in the system's list, by file name."""
    program = shutil.which("ldconfig") or "/sbin/ldconfig"
    try:
        done = subprocess.run(
            [program, "-p"], capture_output=True, text=True, timeout=_LISTING_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return {}
    found: dict[str, list[Path]] = {}
    for line in done.stdout.splitlines():
        name, arrow, place = line.strip().partition(" => ")
        if arrow:
            found.setdefault(name.partition(" ")[0], []).append(Path(place))
    return found


@lru_cache(maxsize=64)
def _defined(path: Path) -> frozenset[str]:
    """Return the versions that an installed library defines; none if it cannot be read."""
    try:
        return read_elf(path.read_bytes()).defined
    except (OSError, ValueError):
        return frozenset()
