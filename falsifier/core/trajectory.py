"""Trajectories: sampled times and one named column per signal."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import instance
from falsifier.core.files import write_whole
from falsifier.core.fixed import FixedDict, fixed
from falsifier.errors import MonitorError, did_you_mean

# Maximum number of distinct values, all integers, of a real signal that is taken for discrete.
_MAX_LEVELS = 16
# By how much a step may differ from the others, and an end from where it should be, as a fraction of a step.
TIME_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Signals sampled on one time grid, read-only.

    Attributes:
        times: sample times in s, shape (n,), from 0 with a constant step.
        columns: one array of shape (n,) per signal, by name; Booleans and integers are stored as floats.
        units: units by signal name; signals without a known unit are missing.
        log: messages of the model during the simulation.

    Raises:
        MonitorError: if the times are no such grid, or a column is not of one number per time.
        SpecError: if times or a column are no array of numpy, such as a list.
    """

    times: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str] = field(default_factory=dict)
    log: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, column in {"times": self.times, **self.columns}.items():
            instance(name, column, np.ndarray, "an array of numpy")
            if column.ndim != 1 or column.dtype.kind not in "fiub":
                raise MonitorError(
                    f"{name}: expected an array of numbers of shape (n,), got {column.dtype} of shape "
                    f"{column.shape}"
                )
            if column.shape != self.times.shape:
                raise MonitorError(
                    f"signal {name!r} has {len(column)} samples, expected {len(self)} as in the time grid"
                )
        steps = np.diff(self.times)
        bound = TIME_TOLERANCE * steps[:1]
        uneven = np.flatnonzero(~(np.absolute(steps - steps[:1]) < bound))
        if len(uneven):
            before, time = self.times[uneven[0] : uneven[0] + 2]
            raise MonitorError(
                f"times: expected a constant, positive step, got {time:g} s after {before:g} s as recorded "
                f"time {uneven[0] + 1}"
            )
        if not (len(self) and abs(self.times[0]) <= bound.sum()):
            raise MonitorError(f"times: expected 0 s as the first one, got {self.times[:1].tolist()}")
        object.__setattr__(self, "times", fixed(self.times))
        object.__setattr__(self, "units", FixedDict(self.units))
        object.__setattr__(self, "columns", FixedDict((n, fixed(c)) for n, c in self.columns.items()))

    def __reduce__(self) -> tuple[type["Trajectory"], tuple[object, ...]]:
        """Pickle the arguments: an array that is unpickled can be changed."""
        return Trajectory, (self.times, self.columns, self.units, self.log)

    def __len__(self) -> int:
        return int(self.times.shape[0])

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            return self.columns[name]
        except KeyError:
            raise MonitorError(
                f"no signal {name!r} in the trajectory; {did_you_mean(name, self.columns)}"
            ) from None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in order."""
        return tuple(self.columns)

    @property
    def step(self) -> float:
        """Sampling step in s."""
        return float(self.times[-1] - self.times[0]) / (len(self) - 1) if len(self) > 1 else 0.0

    def index(self, time: float) -> int:
        """Return the index of the sample nearest to this time in s."""
        return int(np.argmin(np.abs(self.times - time)))

    def at(self, time: float) -> dict[str, float]:
        """Return the values of all signals at the sample nearest to this time in s."""
        k = self.index(time)
        return {name: float(column[k]) for name, column in self.columns.items()}

    def save(self, path: Path) -> None:
        """Write the content to a file, whole or not at all."""
        write_whole(path, self.content())

    def content(self) -> bytes:
        """Return the trajectory, without its log, as a numpy archive (``.npz``)."""
        buffer = BytesIO()
        names = np.array(self.names)
        units = np.array([self.units.get(n, "") for n in self.names])
        stacked = np.array([self.columns[n] for n in self.names]).reshape(-1, len(self))
        np.savez(buffer, times=self.times, names=names, units=units, columns=stacked)
        return buffer.getvalue()

    @classmethod
    def load(cls, place: Path | IO[bytes]) -> "Trajectory":
        """Read a trajectory that ``save`` wrote; MonitorError if it is none."""
        try:
            with np.load(place, allow_pickle=False) as archive:
                if any(entry.compress_type for entry in archive.zip.infolist()):  # it may grow without limit
                    raise ValueError("it is compressed")
                names, units = ([str(each) for each in archive[key]] for key in ("names", "units"))
                columns = dict(zip(names, archive["columns"], strict=True))
                return cls(archive["times"], columns, {n: u for n, u in zip(names, units, strict=True) if u})
        except (OSError, MonitorError):
            raise
        except Exception as error:  # whatever numpy and zipfile raise of other content
            raise MonitorError(f"no recorded trajectory: {error}") from None


def is_discrete(column: NDArray[np.float64], *, kind: str) -> bool:
    """Whether a signal, shape (n,), is of a discrete type, or of a real one but with few integer values."""
    if kind != "real":
        return True
    if np.ptp(column) == 0 or not np.all(column == np.round(column)):
        return False
    return len(np.unique(column)) <= _MAX_LEVELS
