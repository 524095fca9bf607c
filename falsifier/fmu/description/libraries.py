"""Which file of an FMU is the library of each interface on a platform, and Wine for those of Windows."""

import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from falsifier.core.literals import shell_word
from falsifier.core.model import Interface
from falsifier.errors import ModelError
from falsifier.fmu.description import archive

HOW_TO_INSTALL = (
    "install Wine (Debian and Ubuntu: `apt-get install wine64`; Fedora: `dnf install wine-core`; "
    "Arch: `pacman -S wine`)"
)

# Debian's wine64 is in no folder of the search path.
_DEBIAN = Path("/usr/lib/wine/wine64")
# Class with byte order, and machine, of ELF files (System V ABI); machine of PE files ("PE Format").
_ELF = {
    "x86_64-linux": (b"\2\1", b"\x3e\0"),
    "aarch64-linux": (b"\2\1", b"\xb7\0"),
    "x86-linux": (b"\1\1", b"\3\0"),
}
# Enough for the header of a Windows library, which comes after a program for DOS.
_FIRST_BYTES = 4096
_PE_X86_64 = b"\x64\x86"
# These are not part of a name, or of no name that Wine finds.
_UNKNOWN = frozenset('\\"')


@dataclass(frozen=True, slots=True)
class Libraries:
    """Which files of an FMU are its libraries."""

    # Path inside the archive of this platform's library, by interface; missing if there is none.
    here: Mapping[Interface, PurePosixPath]
    windows: Mapping[Interface, PurePosixPath]  # the same for 64-bit Windows
    lacking: Mapping[Interface, str]  # why there is none for this platform and what to do, by interface
    notes: tuple[str, ...]  # what the user should know, one sentence each


def find_libraries(path: Path, fmi_version: str, identifiers: Mapping[Interface, str]) -> Libraries:
    """Look up the libraries in an FMU by their identifiers; the only one for a platform may have any name."""
    names = archive.entry_names(path)
    places, windows_places = (
        {i: archive.library_file(fmi_version, name, platform) for i, name in identifiers.items()}
        for platform in (archive.this_platform(), archive.WINDOWS)
    )
    here, windows = (
        {i: found for i, place in expected.items() if (found := _find(names, place)) is not None}
        for expected in (places, windows_places)
    )
    through_wine = [i for i in windows if i not in here and can_run_windows()]
    lacking = {
        interface: _missing_text(
            path.name,
            names,
            [place, *([windows_places[interface]] if can_run_windows() else [])],
            needs_wine=interface in through_wine,
        )
        for interface, place in places.items()
        if interface not in here
    }
    notes = [*_name_notes(here, places)]
    if through_wine:
        notes += [*_name_notes(windows, windows_places), windows_text()]
    has_sources = any(map(_is_source, names))
    # Wine makes up for a missing library; sources make Wine superfluous.
    if len(lacking) == len(identifiers) and (has_sources or not through_wine):
        notes += lacking.values()
    loaded = [(library, archive.this_platform()) for library in here.values()]
    loaded += [(windows[i], archive.WINDOWS) for i in through_wine]
    for library, platform in loaded:
        if not _is_for(archive.read_entry(path, str(library), _FIRST_BYTES), platform):
            notes.append(f"{library.name} is not a library for {platform}; export the FMU again for it")
    return Libraries(here, windows, lacking, tuple(dict.fromkeys(notes)))


def platforms(names: Iterable[str]) -> tuple[str, ...]:
    """Return the FMI 3 names (``x86_64-linux``) of the platforms for which the entries contain binaries."""
    paths = [PurePosixPath(name).parts for name in names]
    folders = {p[1] for p in paths if len(p) == 3 and p[0] == "binaries"}
    return tuple(sorted({archive.OLD_PLATFORMS.get(folder, folder) for folder in folders}))


def _name_notes(
    found: Mapping[Interface, PurePosixPath], expected: Mapping[Interface, PurePosixPath]
) -> Iterator[str]:
    for interface, path in found.items():
        if path != expected[interface]:
            name = expected[interface].name
            yield f"its library is called {path.name}, not {name}; it is the only one, so it is used"


def _missing_text(
    fmu: str, names: Sequence[str], expected: Sequence[PurePosixPath], *, needs_wine: bool
) -> str:
    """Say that an FMU has no library for this platform, why those that it has do not help, and what does.

    The expected libraries are those that could run here, this platform's first.
    """
    for place in expected[:1] if needs_wine else expected:
        if found := sorted(path.name for path in _beside(names, place)):
            return (
                f"{place.parent} contains {', '.join(found)}, but not {place.name}, and the model identifier "
                "tells which one to load: export the FMU again"
            )
    here, others = archive.this_platform(), platforms(names)
    text = f"no binary for {here}, " + (f"only for {', '.join(others)}" if others else "nor for any other")
    if needs_wine:
        text += "; that for Windows runs through Wine"
    else:
        text += "".join(f"; {reason}" for reason in _reasons(here, others))
    if any(map(_is_source, names)):
        wine = " to run without Wine" if needs_wine else ""
        text += f"; it contains C sources: compile them with `falsifier tools build {shell_word(fmu)}`{wine}"
    elif not needs_wine:
        wine = " or for 64-bit Windows" if "x86-windows" in others and can_run_windows() else ""
        text += f"; export it again for this platform{wine}"
    return f"{text} ({expected[0]} is missing)"


def _is_source(name: str) -> bool:
    return name.startswith("sources/") and name.endswith(".c")


def _is_for(start: bytes, platform: str) -> bool:
    """Whether a file that starts with these bytes can be a library for a platform; True if it is unknown."""
    if platform == archive.WINDOWS:
        at = int.from_bytes(start[0x3C:0x40], "little")
        return start[:2] == b"MZ" and start[at : at + 6] == b"PE\0\0" + _PE_X86_64
    expected = _ELF.get(platform)
    return expected is None or (start[:4], start[4:6], start[18:20]) == (b"\x7fELF", *expected)


def _reasons(here: str, platforms: Sequence[str]) -> Iterator[str]:
    """Yield why binaries for other platforms do not help; one word for each kind."""
    system = here.partition("-")[2]
    if f"x86-{system}" in platforms and here != f"x86-{system}":
        yield "a 32-bit binary cannot be loaded here"
    elif "x86-windows" in platforms and can_run_windows():
        yield "that for 32-bit Windows cannot be run, because Wine is used for 64-bit Windows only"
    if system != "darwin" and any(p.endswith("-darwin") for p in platforms):
        yield "binaries for macOS run only there"


def _beside(names: Iterable[str], expected: PurePosixPath) -> list[PurePosixPath]:
    """Return the libraries in the folder of one, with its ending."""
    paths = (PurePosixPath(name) for name in names)
    return [p for p in paths if p.parent == expected.parent and p.suffix == expected.suffix]


def _find(names: Iterable[str], expected: PurePosixPath) -> PurePosixPath | None:
    found = _beside(names, expected)
    if expected in found:
        return expected
    return found[0] if len(found) == 1 else None


def find_wine() -> Path | None:
    """Return the path of a Wine that runs 64-bit programs; None if there is none."""
    for name in ("wine64", str(_DEBIAN), "wine"):
        if found := shutil.which(name):
            return Path(found)
    return None


def can_run_windows() -> bool:
    """Whether this machine could run Windows libraries if Wine were installed."""
    return archive.this_platform() == "x86_64-linux"


def windows_text() -> str:
    """Say that an FMU runs through Wine, and whether it is installed."""
    found = find_wine()
    state = f"found as {found}" if found else f"which is missing: {HOW_TO_INSTALL}"
    return f"win64 only: runs through Wine, {state}; there it can execute programs, allowed or not"


def windows_path(path: Path) -> str:
    """Return a file's path as Windows programs know it; ModelError if it has characters that they cannot."""
    known = str(path.absolute())
    if not _UNKNOWN.isdisjoint(known):
        raise ModelError(
            f"{known}: Windows programs cannot open a path with a backslash or quotation mark; set TMPDIR to "
            "another folder, or install falsifier in another one"
        )
    return "Z:" + known.replace("/", "\\")
