"""A compiled formula: its steps, and the place of each part's values in the buffer."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.formula import Formula, Predicate
from falsifier.stl.steps import Step


@dataclass(frozen=True, slots=True)
class Place:
    """Location of one part's values in the buffer.

    Attributes:
        base: the value at sample k has the offset ``base + k``.
        first: first computed sample.
        last: last computed sample.
    """

    base: int
    first: int
    last: int

    def at(self, sample: int) -> int:
        """Return the offset in the buffer of the value at this sample."""
        return self.base + sample


@dataclass(frozen=True, slots=True)
class Part:
    """A sub-formula and the location of its values.

    Attributes:
        formula: the sub-formula.
        text: its text.
        place: its samples and their offsets.
        window: window of a temporal operator, in samples from the sample at which it is evaluated; an end of
            None is the last sample of the trajectory.
        samples: number of samples of one trajectory.
        children: parts directly below.
    """

    formula: Formula
    text: str
    place: Place
    window: tuple[int, int | None] | None
    samples: int
    children: tuple["Part", ...]

    def at(self, buffer: NDArray[np.float64], sample: int) -> float:
        """Return the robustness at a sample."""
        return buffer.item(self.place.base + sample)

    def over(self, buffer: NDArray[np.float64], first: int, last: int) -> NDArray[np.float64]:
        """Return the robustness at the samples from first to last inclusive."""
        return buffer[self.place.base + first : self.place.base + last + 1]

    def window_at(self, sample: int) -> tuple[int, int] | None:
        """Return the first and last sample of a temporal operator's window if evaluated at this sample."""
        if self.window is None:
            return None
        start, end = self.window
        return sample + start, self.samples - 1 if end is None else sample + end

    def walk(self) -> Iterator["Part"]:
        """Yield this part and all below it, from left to right."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class Program:
    """Steps, and the place of each part's values.

    Attributes:
        root: the whole formula.
        signals: names of the signals, in their order in the buffer.
        step: sampling step in s.
        samples: number of samples of one trajectory.
        times: the time grid in s, shape (n,).
        steps: what fills the buffer, in order.
        size: length of the buffer.
        checked: the predicate that each check is for, and its place, by the number of the step.
    """

    root: Part
    signals: tuple[str, ...]
    step: float
    samples: int
    times: NDArray[np.float64]
    steps: tuple[Step, ...]
    size: int
    checked: dict[int, tuple[Predicate, Place]]
