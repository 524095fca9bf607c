"""Robustness of many predicted traces at once, on a coarse grid and with scaled margins.

A trace is a trajectory on the grid (``grid.Trace``). A formula is converted to negation normal form over
*leaves*, the signed margins of its predicates. On a coarse grid, samples are not sufficient, because a peak
between two samples may decide an ``always``. A leaf may therefore be an envelope: its value at index k is the
smallest (below an always) or largest (below an eventually) margin in the cell from t_k to t_(k+1).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Literal

import numpy as np

from falsifier.engines.box import Array
from falsifier.stl.formula import (
    Always,
    And,
    Eventually,
    Formula,
    Iff,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
    Window,
)

Envelope = Literal["sample", "low", "high"]
Extreme = np.ufunc  # np.minimum or np.maximum

# Maximum distance in cells of a window bound from a grid point at which it counts as that point.
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Leaf:
    """A predicate's margin in the normal form.

    Attributes:
        predicate: the predicate.
        sign: -1 if the normal form negates it, else 1.
        envelope: whether the value is that of a sample, or the lowest or highest in a cell.
        discrete: whether it only compares signals with few values, so that its margin has no slope.
    """

    predicate: Predicate
    sign: float
    envelope: Envelope
    discrete: bool

    def margin(self, columns: Mapping[str, Any]) -> Array:
        """Return the signed margin for columns of any shape; a discrete one is clipped to [-0.5, 0.5]."""
        value = self.sign * margin(self.predicate, columns)
        return np.clip(value, -0.5, 0.5) if self.discrete else value


class Node(ABC):
    """A node of the normal form; values have shape (traces, grid points)."""

    @abstractmethod
    def value(self, margins: Sequence[Array]) -> Array:
        """Return the robustness at every grid point, computed from the leaves' margins."""

    def start(self, margins: Sequence[Array]) -> Array:
        """Return the robustness at time 0 only, shape (traces,), which is often cheaper."""
        return self.value(margins)[:, 0]

    @property
    def needs_several(self) -> bool:
        """Whether a violation requires several conditions at once: the formula contains a disjunction."""
        return False

    @property
    def cellwise(self) -> bool:
        """Whether the value at k applies to the whole cell after t_k, not only to t_k."""
        return False


@dataclass(frozen=True, slots=True)
class _Atom(Node):
    index: int
    is_cell: bool

    def value(self, margins: Sequence[Array]) -> Array:
        return margins[self.index]

    @property
    def cellwise(self) -> bool:
        return self.is_cell


@dataclass(frozen=True, slots=True)
class _Join(Node):
    parts: tuple[Node, ...]
    extreme: Extreme

    def value(self, margins: Sequence[Array]) -> Array:
        return reduce(self.extreme, (part.value(margins) for part in self.parts))

    def start(self, margins: Sequence[Array]) -> Array:
        return reduce(self.extreme, (part.start(margins) for part in self.parts))

    @property
    def cellwise(self) -> bool:
        return all(part.cellwise for part in self.parts)

    @property
    def needs_several(self) -> bool:
        return self.extreme is np.maximum or any(part.needs_several for part in self.parts)


@dataclass(frozen=True, slots=True)
class _Slide(Node):
    part: Node
    first: int
    last: int
    extreme: Extreme

    def value(self, margins: Sequence[Array]) -> Array:
        return sliding(self.part.value(margins), self.first, self.last, self.extreme)

    def start(self, margins: Sequence[Array]) -> Array:
        values = self.part.value(margins)
        last = values.shape[1] - 1
        within = values[:, min(self.first, last) : min(self.last, last) + 1]
        return np.asarray(self.extreme.reduce(within, axis=1))

    @property
    def needs_several(self) -> bool:
        return self.part.needs_several


@dataclass(frozen=True, slots=True)
class _Until(Node):
    left: Node
    right: Node
    first: int
    last: int
    negated: bool

    def value(self, margins: Sequence[Array]) -> Array:
        # In normal form the operands of a negated until are negated: undo that, and negate the result.
        sign = -1.0 if self.negated else 1.0
        left, right = sign * self.left.value(margins), sign * self.right.value(margins)
        best: Array = np.full_like(right, -np.inf)
        running: Array = np.full_like(left, np.inf)
        for shift in range(min(self.last, left.shape[1] - 1) + 1):
            running = np.minimum(running, shifted(left, shift))
            if shift >= self.first:
                best = np.maximum(best, np.minimum(running, shifted(right, shift)))
        return sign * best

    @property
    def needs_several(self) -> bool:
        return True


@dataclass(frozen=True, slots=True)
class CoarseFormula:
    """A formula compiled for traces on a grid.

    Attributes:
        leaves: margins that ``robustness`` requires, in this order.
        root: the normal form.
    """

    leaves: tuple[Leaf, ...]
    root: Node

    def robustness(self, margins: Sequence[Array]) -> Array:
        """Return the robustness at time 0 of m traces, shape (m,), from one margin array (m, n) per leaf."""
        return self.root.start(margins)

    def deciding(self, margins: Sequence[Array]) -> list[tuple[int, int]]:
        """Return the leaf and the grid index that decide the robustness of each trace.

        The normal form takes only minima and maxima, so the robustness equals one of the margins. A
        different, negligible increment on each margin distinguishes equal ones.
        """
        stacked = np.stack(margins, axis=1).astype(np.float64)
        traces, _, points = stacked.shape
        marks = np.linspace(0.0, 1e-9 * max(1.0, float(np.abs(stacked).max())), stacked[0].size)
        marked = stacked + marks.reshape(stacked.shape[1:])
        values = self.robustness([marked[:, i] for i in range(len(margins))])
        places = np.abs(marked.reshape(traces, -1) - values[:, None]).argmin(axis=1)
        return [divmod(int(place), points) for place in places]


def coarse_formula(
    formula: Formula, step: float, *, discrete: frozenset[str] = frozenset(), stretch: float = 1.0
) -> CoarseFormula:
    """Compile a formula for a grid.

    Args:
        formula: the requirement.
        step: step of the grid in s.
        discrete: names of signals that have only a few values.
        stretch: factor for the end of every always window below another temporal operator.
    """
    builder = _Builder(step, discrete, stretch, sampled=_has_short_window(formula, step))
    root = builder.build(formula, sign=1, above=None)
    return CoarseFormula(tuple(builder.leaves), root)


@dataclass(slots=True)
class _Builder:
    step: float
    discrete: frozenset[str]
    stretch: float
    sampled: bool
    leaves: list[Leaf]

    def __init__(self, step: float, discrete: frozenset[str], stretch: float, *, sampled: bool) -> None:
        self.step, self.discrete, self.stretch, self.sampled = step, discrete, stretch, sampled
        self.leaves = []

    def build(self, formula: Formula, *, sign: int, above: Extreme | None) -> Node:
        match formula:
            case Predicate():
                return self._atom(formula, sign, above)
            case Not(operand):
                return self.build(operand, sign=-sign, above=above)
            case And(left, right) | Or(left, right):
                extreme = _extreme(smallest=isinstance(formula, And) == (sign > 0))
                parts = tuple(self.build(part, sign=sign, above=above) for part in (left, right))
                return _Join(parts, extreme)
            case Implies(left, right):
                return self.build(Or(Not(left), right), sign=sign, above=above)
            case Iff(left, right):
                both = And(Implies(left, right), Implies(right, left))
                return self.build(both, sign=sign, above=above)
            case Always(operand, window) | Eventually(operand, window):
                smallest = isinstance(formula, Always) == (sign > 0)
                extreme = _extreme(smallest=smallest)
                stretch = self.stretch if smallest and above is not None else 1.0
                part = self.build(operand, sign=sign, above=extreme)
                first, last = self._indices(window, stretch, cellwise=part.cellwise)
                return _Slide(part, first, last, extreme)
            case Until(left, right, window):
                held = self.build(left, sign=sign, above=_extreme(smallest=sign > 0))
                reached = self.build(right, sign=sign, above=_extreme(smallest=sign < 0))
                first, last = self._indices(window, 1.0, cellwise=False)
                return _Until(held, reached, first, last, negated=sign < 0)
            case Next(operand):
                part = self.build(operand, sign=sign, above=above)
                if isinstance(part, _Slide):
                    return replace(part, first=part.first + 1, last=part.last + 1)
                return _Slide(part, 1, 1, np.minimum)
        raise TypeError(f"no coarse robustness for {type(formula).__name__}")

    def _atom(self, predicate: Predicate, sign: int, above: Extreme | None) -> Node:
        names = {*predicate.left.signals, *predicate.right.signals}
        discrete = bool(names) and names <= self.discrete
        envelope: Envelope = "sample"
        if above is not None and not self.sampled and not discrete:
            envelope = "low" if above is np.minimum else "high"
        self.leaves.append(Leaf(predicate, float(sign), envelope, discrete))
        return _Atom(len(self.leaves) - 1, envelope != "sample")

    def _indices(self, window: Window | None, stretch: float, *, cellwise: bool) -> tuple[int, int]:
        if window is None:
            return 0, 10**6  # to the end of any grid
        start, end = window.start / self.step, window.end * stretch / self.step
        if window.end < self.step and window.end > 0:
            # A window shorter than a cell is approximated by the next grid point.
            return 1, 1
        first = int(np.ceil(start - _ROUNDING))
        last = int(np.floor(end + _ROUNDING))
        return first, max(first, last - 1 if cellwise else last)


def margin(predicate: Predicate, columns: Mapping[str, Any]) -> Array:
    """Return the robustness of a predicate for columns of any shape."""
    left, right = predicate.left.evaluate(columns), predicate.right.evaluate(columns)
    match predicate.operator:
        case "<" | "<=":
            return right - left
        case ">" | ">=":
            return left - right
        case "==":
            return -np.abs(left - right)
        case "!=":
            return np.abs(left - right)


def sliding(values: Array, first: int, last: int, extreme: Extreme) -> Array:
    """Return the extreme of values[:, k + first ... k + last] for each k, with the last value extended."""
    from falsifier.engines.surrogate.kernels import slide

    count = values.shape[1]
    first, last = min(first, count - 1), min(last, count - 1)
    if first == last:
        return np.concatenate([values[:, first:], np.repeat(values[:, -1:], first, axis=1)], axis=1)
    result = np.empty_like(values, order="C")
    sign = 1 if extreme is np.minimum else -1
    slide(np.ascontiguousarray(values), first, last, sign, result)
    return result


def shifted(values: Array, shift: int) -> Array:
    """Return the values ``shift`` grid points later; the last value is repeated at the end."""
    return sliding(values, shift, shift, np.minimum)


def inner_windows(formula: Formula, *, nested: bool = False) -> list[float]:
    """Return the lengths in s of the windows below another temporal operator."""
    lengths = []
    if isinstance(formula, (Always, Eventually, Until)):
        if nested and formula.window is not None:
            lengths.append(formula.window.end - formula.window.start)
        nested = True
    for child in formula.children:
        lengths += inner_windows(child, nested=nested)
    return lengths


def _extreme(*, smallest: bool) -> Extreme:
    return np.minimum if smallest else np.maximum


def _has_short_window(formula: Formula, step: float) -> bool:
    return any(
        isinstance(f, Next)
        or (isinstance(f, (Always, Eventually)) and f.window is not None and 0 < f.window.end < step)
        for f in formula.walk()
    )
