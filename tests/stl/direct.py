"""The semantics written down once more, as slow and direct as the definition."""

import math
from collections.abc import Callable, Mapping
from operator import eq, ge, gt, itemgetter, le, lt, ne

import numpy as np
from numpy.typing import NDArray

from falsifier.stl import formula as stl
from falsifier.stl.margins import on_limit

TRUE_IF: dict[stl.Comparison, Callable[[float, float], bool]] = {
    "<": lt, "<=": le, ">": gt, ">=": ge, "==": eq, "!=": ne,
}  # fmt: skip
Columns = Mapping[str, NDArray[np.float64]]


class Direct:
    """Robustness and critical sample of formulas on columns with a sampling step."""

    def __init__(self, columns: Columns, step: float) -> None:
        self.columns = columns
        self.step = step
        self.n = len(next(iter(columns.values())))

    def samples(self, window: stl.Window | None, k: int) -> range:
        if window is None:
            return range(k, self.n)
        return range(k + round(window.start / self.step), k + round(window.end / self.step) + 1)

    def judge(self, f: stl.Formula, k: int = 0) -> tuple[float, int]:
        """Robustness at sample k and the sample that decided it."""
        if isinstance(f, stl.Constant):
            return math.inf if f.value else -math.inf, k
        if isinstance(f, stl.Predicate):
            here = {name: column[k] for name, column in self.columns.items()}
            one, other = float(f.left.evaluate(here)), float(f.right.evaluate(here))
            margin = {
                "<": other - one, "<=": other - one, ">": one - other, ">=": one - other,
                "==": -abs(one - other), "!=": abs(one - other),
            }[f.operator]  # fmt: skip
            return margin or on_limit(f.operator), k
        match f:
            case stl.Not(operand):
                value, at = self.judge(operand, k)
                return -value, at
            case stl.And(left, right):
                return smaller(self.judge(left, k), self.judge(right, k))
            case stl.Or(left, right):
                return self.judge(stl.Not(stl.And(stl.Not(left), stl.Not(right))), k)
            case stl.Implies(left, right):
                return self.judge(stl.Not(stl.And(left, stl.Not(right))), k)
            case stl.Iff(left, right):
                return self.judge(stl.And(stl.Implies(left, right), stl.Implies(right, left)), k)
            case stl.Next(operand):
                return self.judge(operand, k + 1)
            case stl.Always(operand, window):
                return min((self.judge(operand, i) for i in self.samples(window, k)), key=itemgetter(0))
            case stl.Eventually(operand, window):
                return self.judge(stl.Not(stl.Always(stl.Not(operand), window)), k)
            case stl.Until(left, right, window):
                ends = [self._until(left, right, k, end) for end in self.samples(window, k)]
                return max(ends, key=itemgetter(0))
        raise TypeError(f"not a formula: {f!r}")

    def _until(self, left: stl.Formula, right: stl.Formula, k: int, end: int) -> tuple[float, int]:
        lowest = min((self.judge(left, i) for i in range(k, end + 1)), key=itemgetter(0))
        return smaller(lowest, self.judge(right, end))

    def holds(self, f: stl.Formula, k: int = 0) -> bool:
        """Whether a formula is true at sample k, without any margin."""
        match f:
            case stl.Predicate(operator, left, right):
                here = {name: column[k] for name, column in self.columns.items()}
                return TRUE_IF[operator](float(left.evaluate(here)), float(right.evaluate(here)))
            case stl.Not(operand):
                return not self.holds(operand, k)
            case stl.And(left, right):
                return self.holds(left, k) and self.holds(right, k)
            case stl.Or(left, right):
                return self.holds(left, k) or self.holds(right, k)
            case stl.Implies(left, right):
                return not self.holds(left, k) or self.holds(right, k)
            case stl.Iff(left, right):
                return self.holds(left, k) == self.holds(right, k)
            case stl.Next(operand):
                return self.holds(operand, k + 1)
            case stl.Always(operand, window):
                return all(self.holds(operand, i) for i in self.samples(window, k))
            case stl.Eventually(operand, window):
                return any(self.holds(operand, i) for i in self.samples(window, k))
            case stl.Until(left, right, window):
                return any(
                    self.holds(right, end) and all(self.holds(left, i) for i in range(k, end + 1))
                    for end in self.samples(window, k)
                )
        raise TypeError(f"not a formula: {f!r}")


def smaller(left: tuple[float, int], right: tuple[float, int]) -> tuple[float, int]:
    return left if left[0] <= right[0] else right
