"""A compiled formula: the steps for the kernels, and where they leave the value of each part."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.formula import Formula, Predicate


@dataclass(frozen=True, slots=True)
class Place:
    """Where the values of one part lie.

    Attributes:
        base: offset of the value at sample k is ``base + k``.
        first: first sample that was computed.
        last: last sample that was computed.
    """

    base: int
    first: int
    last: int

    def at(self, sample: int) -> int:
        """Offset in the buffer of the value at this sample."""
        return self.base + sample


@dataclass(frozen=True, slots=True)
class Part:
    """A sub-formula and where its values lie.

    Attributes:
        formula: the sub-formula.
        text: its text.
        place: its samples and their offsets.
        window: of a temporal operator, in samples from where it stands; without an end it reaches to the last
            sample of all.
        samples: samples of one trajectory.
        children: parts directly below.
    """

    formula: Formula
    text: str
    place: Place
    window: tuple[int, int | None] | None
    samples: int
    children: tuple["Part", ...]

    def at(self, buffer: NDArray[np.float64], sample: int) -> float:
        """Robustness at a sample."""
        return buffer.item(self.place.base + sample)

    def over(self, buffer: NDArray[np.float64], first: int, last: int) -> NDArray[np.float64]:
        """Robustness at the samples from first to last."""
        return buffer[self.place.base + first : self.place.base + last + 1]

    def window_at(self, sample: int) -> tuple[int, int] | None:
        """First and last sample that a temporal operator looks at from here."""
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
    """Steps for the kernels, and where they leave the value of each part.

    Attributes:
        root: the whole formula.
        signals: names in the order in which the buffer holds them.
        step: sampling step in s.
        samples: samples of one trajectory.
        rows: steps as described in opcodes, shape (r, 6).
        numbers: two constants for each step, shape (r, 2).
        size: length of the buffer.
        checked: the predicate that each checking row looks at, and its place.
    """

    root: Part
    signals: tuple[str, ...]
    step: float
    samples: int
    rows: NDArray[np.int64]
    numbers: NDArray[np.float64]
    size: int
    checked: dict[int, tuple[Predicate, Place]]
