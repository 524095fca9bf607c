"""Simulations at the output interval, and their pieces of smooth motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array

# An acceleration that changes by more than this share of the typical one between samples is an event.
_KINK = 0.1
# Scaled inputs that change by more than this between samples have switched.
_SWITCHED = 0.02
# Fewest samples of a piece: its acceleration needs one sample before and one after.
_SHORTEST = 3
# A piece of so many samples can do without its ends.
_TRIMMED = 5


@dataclass(frozen=True)
class Recording:
    """One simulation.

    Attributes:
        step: output interval in s.
        outputs: shape (samples, n).
        inputs: inputs and parameters, scaled to [0, 1], shape (samples, p).
    """

    step: float
    outputs: Array
    inputs: Array

    @cached_property
    def acceleration(self) -> Array:
        """Second differences of the outputs at samples 1, 2, ..., shape (samples - 2, n)."""
        return np.asarray(np.diff(self.outputs, 2, axis=0) / self.step**2)

    @cached_property
    def velocity(self) -> Array:
        """Central differences of the outputs at samples 1, 2, ..., shape (samples - 2, n)."""
        return np.asarray((self.outputs[2:] - self.outputs[:-2]) / (2 * self.step))

    @property
    def starting_velocity(self) -> Array:
        """Velocities at the start, shape (n,)."""
        return np.asarray(self.velocity[0] - self.step * self.acceleration[0])

    @cached_property
    def kinks(self) -> int:
        """Number of events of all outputs, roughly."""
        return sum(int(np.sum(~_is_even(a, _typical(a)))) for a in self.acceleration.T)

    @cached_property
    def is_driven_smoothly(self) -> NDArray[np.bool_]:
        """Whether no input switches within two samples of samples 1, 2, ..., shape (samples - 2,)."""
        switched = (np.abs(np.diff(self.inputs, axis=0)) > _SWITCHED).any(axis=1)
        padded = np.concatenate([[False], switched, [False]])
        return np.asarray(~(padded[:-3] | padded[1:-2] | padded[2:-1] | padded[3:]))


@dataclass(frozen=True, slots=True)
class Piece:
    """Smooth motion of one output: samples start + 1 to stop of a recording, without an event in between.

    An event next to it may have a small effect on its first and last acceleration.
    """

    recording: int
    start: int
    stop: int

    @property
    def first(self) -> int:
        """First row of acceleration and velocity without such an effect, if the piece is long enough."""
        return self.start + (self.stop - self.start >= _TRIMMED)

    @property
    def last(self) -> int:
        """Last such row."""
        return self.stop - 1 - (self.stop - self.start >= _TRIMMED)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One output in all recordings.

    Attributes:
        output: index of the output.
        unit: typical acceleration.
        pieces: pieces of smooth motion, in order.
        is_smooth: for each recording, whether no event lies between samples k + 1 and k + 2, shape
            (samples - 3,).
    """

    output: int
    unit: float
    pieces: tuple[Piece, ...]
    is_smooth: tuple[NDArray[np.bool_], ...]

    @classmethod
    def of(cls, recordings: Sequence[Recording], output: int) -> "Motion":
        """Divide an output's motion at its events and where inputs switch."""
        driven = [r.acceleration[r.is_driven_smoothly, output] for r in recordings]
        unit = _typical(np.concatenate(driven))
        pieces: list[Piece] = []
        is_smooth = []
        for k, recording in enumerate(recordings):
            even = _is_even(recording.acceleration[:, output], unit)
            smooth = recording.is_driven_smoothly
            breaks = np.flatnonzero(~(even & smooth[1:] & smooth[:-1])) + 1
            edges = np.concatenate([[0], breaks, [len(even) + 1]])
            pieces += [Piece(k, int(a), int(b)) for a, b in pairwise(edges) if b - a >= _SHORTEST]
            is_smooth.append(even)
        return cls(output, unit, tuple(pieces), tuple(is_smooth))

    @property
    def samples(self) -> int:
        """Number of samples in the pieces."""
        return sum(p.stop - p.start for p in self.pieces)


def _typical(acceleration: Array) -> float:
    """Return the median size of what is not 0; 1 if all is."""
    sizes = np.abs(acceleration)
    moving = sizes[sizes > 1e-6 * sizes.max(initial=0.0)]
    return float(np.median(moving)) if len(moving) else 1.0


def _is_even(acceleration: Array, unit: float) -> NDArray[np.bool_]:
    """Return whether an acceleration hardly changes from each sample to the next, shape (samples - 1,)."""
    return np.asarray(np.abs(np.diff(acceleration)) <= _KINK * unit)
