"""Driving an output further than any simulation has, where the robustness shows no way down.

A limiter, a mode or a counter often depends on a signal that the requirement does not name: as long as the
signal stays within its usual range, the robustness stays the same. Dynamics can plan how to leave that range.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.surrogate.history import Sample

# Number of plans that drive an output one way without anything new happening, after which it is left alone.
_MOST_TRIES = 3


@dataclass(frozen=True, slots=True)
class Push:
    """An output and the direction in which it is driven.

    Attributes:
        output: name of the output.
        column: its column in the states of traces.
        sign: 1: up, -1: down.
    """

    output: str
    column: int
    sign: int

    def heights(self, states: Array) -> Array:
        """Return how far the output went at each time, shape (..., cells + 1), in states with columns."""
        return np.asarray(self.sign * states[..., self.column])

    def __str__(self) -> str:
        """Return what a plan does, in words."""
        return f"drives {self.output} further {'up' if self.sign > 0 else 'down'}"


@dataclass(slots=True)
class Pushes:
    """Which outputs were driven which way, and how often since that last brought something new."""

    _tries: dict[Push, int] = field(default_factory=dict)

    def know(self, outputs: Sequence[str], continuous: Sequence[str]) -> None:
        """Add the outputs, of all that are predicted, that are continuous."""
        for name in continuous:
            for sign in (1, -1):
                self._tries.setdefault(Push(name, outputs.index(name), sign), 0)

    @property
    def is_done(self) -> bool:
        """Whether nothing is left that is worth trying."""
        return min(self._tries.values(), default=_MOST_TRIES) >= _MOST_TRIES

    def next(self, rng: np.random.Generator) -> Push:
        """Return the one that was tried the least, and count it."""
        push = min(self._tries, key=lambda p: (self._tries[p], rng.random()))
        self._tries[push] += 1
        return push

    def succeeded(self, push: Push) -> None:
        """Note that it made a discrete signal do something new: it is worth more tries."""
        self._tries[push] = 0


def by_height(push: Push, samples: Sequence[Sample], cells: int) -> tuple[list[int], Array]:
    """Return the indices of the samples, that in which the output went furthest first, and when each did so.

    Args:
        push: the output and the direction.
        samples: at least one sample.
        cells: number of cells of the horizon.

    Returns:
        The order of the samples, and the times as shares of the horizon, shape (samples,).
    """
    heights = np.array([push.heights(s.trace.states[: cells + 1]) for s in samples])
    order = np.argsort(-heights.max(axis=1), kind="stable")
    return order.tolist(), np.argmax(heights, axis=1) / cells
