"""Which file of an FMU is the library of each interface on a platform."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath

from falsifier.core.model import Interface
from falsifier.fmu import archive


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
    system = here.partition("-")[2]
    text = f"no binary for {here}, " + (
        f"only for {', '.join(platforms)}" if platforms else "nor for any other"
    )
    if needs_wine:
        text += "; that for Windows runs through Wine"
        build = f"; it contains C sources: compile them with `falsifier build {name}` to run without Wine"
        return text + (build if has_sources else "")
    if f"x86-{system}" in platforms and here != f"x86-{system}":
        text += "; a 32-bit binary cannot be loaded here"
    elif platforms and all(p.endswith("-darwin") for p in platforms):
        text += "; binaries for macOS run only there"
    if has_sources:
        return f"{text}; it contains C sources: compile them with `falsifier build {name}`"
    return f"{text}; export it again for this platform"


def _find(names: Iterable[str], expected: PurePosixPath) -> PurePosixPath | None:
    paths = (PurePosixPath(name) for name in names)
    found = [p for p in paths if p.parent == expected.parent and p.suffix == expected.suffix]
    if expected in found:
        return expected
    return found[0] if len(found) == 1 else None
