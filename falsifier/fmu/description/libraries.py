"""Which file of an FMU is the library of each interface on a platform, and Wine for those of Windows."""

import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path, PurePosixPath

from falsifier.core.model import Interface
from falsifier.errors import ModelError
from falsifier.fmu.description import archive

HOW_TO_INSTALL = (
    "install Wine (Debian and Ubuntu: `apt-get install wine64`; Fedora: `dnf install wine-core`; "
    "Arch: `pacman -S wine`)"
)

# Debian's wine64 is in no folder of the search path.
_DEBIAN = Path("/usr/lib/wine/wine64")
# Where Wine's own libraries are, below a folder above its program.
_OWN_LIBRARIES = ("lib*/wine/x86_64-windows", "lib*/*/wine/x86_64-windows")
# These are not part of a name, or of no name that Wine finds.
_UNKNOWN = frozenset('\\"')


def find_libraries(
    names: Sequence[str], fmi_version: str, identifiers: Mapping[Interface, str], platform: str = ""
) -> tuple[dict[Interface, PurePosixPath], tuple[str, ...]]:
    """Look up the libraries among an FMU's entries; the only one for a platform may have any name.

    Args:
        names: names of the entries.
        fmi_version: FMI version of the FMU.
        identifiers: model identifier by interface.
        platform: FMI 3 name of the platform; empty for this one.

    Returns:
        The path of the library by interface, missing if there is none, and what the user should know.
    """
    libraries: dict[Interface, PurePosixPath] = {}
    said: list[str] = []
    for interface, identifier in identifiers.items():
        expected = archive.library_file(fmi_version, identifier, platform)
        found = _find(names, expected)
        if found is None:
            continue
        libraries[interface] = found
        if found != expected:
            said.append(
                f"its library is called {found.name}, not {expected.name}; it is the only one, so it is used"
            )
    return libraries, tuple(dict.fromkeys(said))


def misnamed_text(names: Sequence[str], fmi_version: str, identifiers: Iterable[str]) -> str:
    """Say that there are libraries that could run on this machine, but none with the right name.

    Args:
        names: names of the FMU's entries.
        fmi_version: its FMI version.
        identifiers: model identifiers whose libraries are missing.

    Returns:
        The text; empty if there are no such libraries.
    """
    for platform in (archive.this_platform(), *([archive.WINDOWS] if can_run_windows() else [])):
        expected = [archive.library_file(fmi_version, i, platform) for i in dict.fromkeys(identifiers)]
        found = sorted({path.name for place in expected for path in _beside(names, place)})
        if found and not any(_find(names, place) for place in expected):
            wanted = " or ".join(place.name for place in expected)
            return (
                f"{expected[0].parent} contains {', '.join(found)}, but not {wanted}, and the model "
                "identifier tells which one to load: export the FMU again"
            )
    return ""


def missing_binary_text(
    name: str, platforms: Sequence[str], *, has_sources: bool, needs_wine: bool = False
) -> str:
    """Say that an FMU has no binary for this platform, why those that it has do not help, and what does.

    Args:
        name: file name of the FMU.
        platforms: platforms for which it contains binaries.
        has_sources: whether it contains C sources.
        needs_wine: whether its binary for Windows can be simulated here.
    """
    here = archive.this_platform()
    text = f"no binary for {here}, " + (
        f"only for {', '.join(platforms)}" if platforms else "nor for any other"
    )
    if needs_wine:
        text += "; that for Windows runs through Wine"
        build = (
            f"; it contains C sources: compile them with `falsifier tools build {name}` to run without Wine"
        )
        return text + (build if has_sources else "")
    text += "".join(f"; {reason}" for reason in _reasons(here, platforms))
    if has_sources:
        return f"{text}; it contains C sources: compile them with `falsifier tools build {name}`"
    wine = " or for 64-bit Windows" if "x86-windows" in platforms and can_run_windows() else ""
    return f"{text}; export it again for this platform{wine}"


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


@lru_cache(maxsize=1)
def wine_libraries() -> frozenset[str]:
    """Return the names of Wine's own libraries for 64-bit programs, in lower case; none if unknown."""
    found = find_wine()
    for folder in found.resolve().parents if found is not None else ():
        for pattern in _OWN_LIBRARIES:
            for place in folder.glob(pattern):
                return frozenset(path.name.lower() for path in place.iterdir())
    return frozenset()


def can_run_windows() -> bool:
    """Whether this machine could run Windows libraries if Wine were installed."""
    return archive.this_platform() == "x86_64-linux"


def windows_text() -> str:
    """Say that an FMU runs through Wine, and whether it is installed."""
    found = find_wine()
    state = f"found as {found}" if found else f"which is missing: {HOW_TO_INSTALL}"
    return f"win64 only: runs through Wine, {state}; there it can execute programs, allowed or not"


def windows_path(path: Path) -> str:
    """Return the path by which Windows programs know a file of this machine.

    Raises:
        ModelError: if it contains characters by which they cannot know it.
    """
    known = str(path.absolute())
    if not _UNKNOWN.isdisjoint(known):
        raise ModelError(
            f"{known}: Windows programs cannot open a path with a backslash or quotation mark; set TMPDIR to "
            "another folder, or install falsifier in another one"
        )
    return "Z:" + known.replace("/", "\\")
