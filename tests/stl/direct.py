"""The semantics written down once more, as slow and direct as the definition."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from falsifier.stl.constants import Constant
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

Columns = Mapping[str, NDArray[np.float64]]


class Direct:
    """Robustness and critical sample of formulas on columns with a sampling step."""

    def __init__(self, columns: Columns, step: float) -> None:
        self.columns = columns
        self.step = step
        self.n = len(next(iter(columns.values())))

    def samples(self, window: Window | None, k: int) -> range:
        if window is None:
            return range(k, self.n)
        return range(k + round(window.start / self.step), k + round(window.end / self.step) + 1)

    def judge(self, f: Formula, k: int = 0) -> tuple[float, int]:
        """Robustness at sample k and the sample that decided it."""
        if isinstance(f, Constant):
            return math.inf if f.value else -math.inf, k
        if isinstance(f, Predicate):
            here = {name: column[k] for name, column in self.columns.items()}
            left, right = float(f.left.evaluate(here)), float(f.right.evaluate(here))
            margin = {
                "<": right - left, "<=": right - left, ">": left - right, ">=": left - right,
                "==": -abs(left - right), "!=": abs(left - right),
            }[f.operator]  # fmt: skip
            return margin, k
        if isinstance(f, Not):
            value, at = self.judge(f.operand, k)
            return -value, at
        if isinstance(f, And):
            return smaller(self.judge(f.left, k), self.judge(f.right, k))
        if isinstance(f, Or):
            return self.judge(Not(And(Not(f.left), Not(f.right))), k)
        if isinstance(f, Implies):
            return self.judge(Not(And(f.left, Not(f.right))), k)
        if isinstance(f, Iff):
            return self.judge(And(Implies(f.left, f.right), Implies(f.right, f.left)), k)
        if isinstance(f, Next):
            return self.judge(f.operand, k + 1)
        if isinstance(f, Always):
            return first_smallest([self.judge(f.operand, i) for i in self.samples(f.window, k)])
        if isinstance(f, Eventually):
            value, at = first_smallest([self.judge(Not(f.operand), i) for i in self.samples(f.window, k)])
            return -value, at
        assert isinstance(f, Until)
        ends = [self._until(f, k, end) for end in self.samples(f.window, k)]
        return max(ends, key=lambda pair: pair[0])

    def _until(self, f: Until, k: int, end: int) -> tuple[float, int]:
        left = first_smallest([self.judge(f.left, i) for i in range(k, end + 1)])
        right = self.judge(f.right, end)
        return smaller(left, right)


def smaller(left: tuple[float, int], right: tuple[float, int]) -> tuple[float, int]:
    return left if left[0] <= right[0] else right


def first_smallest(pairs: list[tuple[float, int]]) -> tuple[float, int]:
    return min(pairs, key=lambda pair: pair[0])
