"""What a worker shares with this process: memory for numbers, and a file for what it prints."""

import mmap
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core import posix_files
from falsifier.core.literals import printable
from falsifier.fmu.process.plan import Plan

# Numbers at the start of the memory; their positions are those of ``enum header`` in worker.h.
HEADER = 8
_RUNNING, _SIMULATED = 0, 1
_MOST_BYTES = 1 << 20
# The end of long output says most about what went wrong.
_SHOWN_BYTES = 64 << 10
_DROPPED = "(further output was dropped)"


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Arrays that a plan's simulations read from and write to.

    Attributes:
        header: what the worker tells while it simulates, shape (8,); it may write anything there.
        parameters: values to set, shape (parameters,).
        inputs: each input as a piecewise cubic (``Signal.pieces``), shape (inputs, 5 * pieces); unused pieces
            start at inf.
        outputs: recorded values by output and sample, shape (outputs, samples).
    """

    header: NDArray[np.float64]
    parameters: NDArray[np.float64]
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]

    @staticmethod
    def size(plan: Plan) -> int:
        """Return the number of float64 values that a plan needs."""
        rows = len(plan.inputs) * 5 * plan.pieces + len(plan.outputs) * plan.samples
        return HEADER + len(plan.parameters) + rows

    @classmethod
    def over(cls, plan: Plan, memory: NDArray[np.float64]) -> "Room":
        """Return a plan's arrays as views of a flat array of at least ``size`` float64 values."""
        a = HEADER + len(plan.parameters)
        b = a + len(plan.inputs) * 5 * plan.pieces
        c = b + len(plan.outputs) * plan.samples
        return cls(
            memory[:HEADER],
            memory[HEADER:a],
            memory[a:b].reshape(len(plan.inputs), 5 * plan.pieces),
            memory[b:c].reshape(len(plan.outputs), plan.samples),
        )


class Memory:
    """Float64 values that this process and a worker share; they can become more.

    Where no process can shorten the file, both map it. Elsewhere this process would die with it, and so it
    writes and reads the file instead.

    Args:
        path: of the file, for a worker that cannot get a descriptor; None: it has no name.

    Attributes:
        values: the values.
        path: as above.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        if path is None:
            self._file = posix_files.sealed_file(0, may_grow=True)
        else:
            self._file = path.open("x+b", buffering=0)
        self._is_mapped = path is None and posix_files.can_seal()
        self.values: NDArray[np.float64] = np.zeros(0)

    def fileno(self) -> int:
        """Descriptor of the file."""
        return self._file.fileno()

    def fit(self, count: int) -> None:
        """Make room for at least this many values.

        Raises:
            OSError: if there is none, or files may not be so large.
        """
        if count <= len(self.values):
            return
        try:
            self._file.truncate(8 * count)
        except OSError as error:
            error.filename = "memory shared with the processes of FMUs"  # the file itself has no name
            raise
        if self._is_mapped:
            self.values = np.frombuffer(mmap.mmap(self.fileno(), 8 * count), dtype=np.float64)
        else:
            self.values = np.zeros(count)

    def give(self) -> None:
        """Let the worker see the values."""
        if not self._is_mapped:
            os.pwrite(self.fileno(), self.values.tobytes(), 0)

    def take(self) -> None:
        """See what the worker has written."""
        if not self._is_mapped:
            read = os.pread(self.fileno(), self.values.nbytes, 0)
            found = np.frombuffer(read[: len(read) // 8 * 8], dtype=np.float64)
            self.values[: len(found)] = found
            self.values[len(found) :] = np.nan

    @property
    def component(self) -> float:
        """Position of the component of a system that runs, as the worker says."""
        return float(self._header()[_RUNNING])

    @property
    def simulated(self) -> float:
        """Time in s that has been simulated, as the worker says."""
        return float(self._header()[_SIMULATED])

    def close(self) -> None:
        """Close the file; the values stay."""
        self._file.close()

    def _header(self) -> NDArray[np.float64]:
        if self._is_mapped or self._file.closed:
            return self.values if len(self.values) >= HEADER else np.zeros(HEADER)
        read = os.pread(self.fileno(), 8 * HEADER, 0)
        return np.frombuffer(read.ljust(8 * HEADER, b"\0"), dtype=np.float64)


class Output:
    """A file for a process's output, with a position that it shares with this process."""

    def __init__(self) -> None:
        self._file = posix_files.sealed_file(_MOST_BYTES)

    def fileno(self) -> int:
        """Descriptor of the file, for the process that prints."""
        return self._file.fileno()

    def take(self, until: int | None = None) -> tuple[str, ...]:
        """Return the lines printed since the last call; only the last of much output.

        Args:
            until: position where they end, if the process goes on printing; it may say anything.
        """
        position = os.lseek(self.fileno(), 0, os.SEEK_CUR)
        if not position:
            return ()
        # The process may have moved the position, which would otherwise be the number of bytes.
        size = min(position, _MOST_BYTES if until is None else until, _MOST_BYTES)
        text = os.pread(self.fileno(), min(size, _SHOWN_BYTES), max(0, size - _SHOWN_BYTES))
        os.lseek(self.fileno(), 0, os.SEEK_SET)
        lines = tuple(printable(text.decode("utf-8", "replace")).splitlines())
        return lines if size < _MOST_BYTES else (*lines, _DROPPED)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
