"""Wine: found on this machine, and what users are told about it."""

import shutil
from functools import lru_cache
from pathlib import Path

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
    return f"win64 only: runs through Wine, {state}"


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
