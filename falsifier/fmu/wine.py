"""Wine: found on this machine, and what users are told about it."""

import shutil
from pathlib import Path

from falsifier.fmu import archive

HOW_TO_INSTALL = (
    "install Wine (Debian and Ubuntu: `apt-get install wine64`; Fedora: `dnf install wine-core`; "
    "Arch: `pacman -S wine`)"
)

# Debian's wine64 is in no folder of the search path.
_DEBIAN = Path("/usr/lib/wine/wine64")


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
    return f"win64 only: runs through Wine, {state}"


def windows_path(path: Path) -> str:
    """Return the path by which Windows programs know a file of this machine."""
    return "Z:" + str(path.absolute()).replace("/", "\\")
