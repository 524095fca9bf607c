"""Memory that a worker shares with the process that requests simulations."""

import contextlib
import mmap
import tempfile
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from falsifier.core import operating_system


class Shared:
    """Float64 values in memory shared with a worker, and what the worker attaches them by.

    Attributes:
        values: the values, zeros at first.
        place: path of the file that contains them; empty: it has no name, and is sent as a descriptor.
        descriptors: descriptors to send.
    """

    def __init__(self, file: IO[bytes], size: int, place: str = "") -> None:
        self._file = file
        self.values = _values(file.fileno(), size)
        self.place = place
        self.descriptors = () if place else (file.fileno(),)

    def close(self) -> None:
        """Close the file, which the worker has opened; the values stay."""
        self._file.close()
        if self.place:
            with contextlib.suppress(OSError):  # Windows: removed with the folder
                Path(self.place).unlink()


def share_unnamed(size: int) -> Shared:
    """Share this many bytes through a file without a name, whose size no process can change (Linux)."""
    return Shared(operating_system.sealed_file(size), size)


def share_named(size: int, folder: Path) -> Shared:
    """Share this many bytes through a file in a folder.

    For Windows, where files cannot be sent, and cannot be shortened while a process has them mapped.
    """
    with tempfile.NamedTemporaryFile(dir=folder, prefix="memory-", delete=False) as made:
        made.truncate(size)
    return Shared(Path(made.name).open("r+b", buffering=0), size, made.name)


def attach(place: str, descriptors: list[int]) -> NDArray[np.float64]:
    """Return the values that another process shares, by what ``Shared`` says of them."""
    if not place:
        return _values(descriptors[0], 0)
    with Path(place).open("r+b", buffering=0) as file:
        return _values(file.fileno(), 0)


def _values(descriptor: int, size: int) -> NDArray[np.float64]:
    return np.frombuffer(mmap.mmap(descriptor, size), dtype=np.float64)
