"""A formula as conditions that ``and``, ``or``, ``not`` and ``->`` join at its top: one number each.

The robustness of a condition is smoother than their minimum or maximum, whose kinks lie where the search has
to go. So processes learn the conditions, and the formula joins what they predict (Astudillo and Frazier,
Bayesian optimization of composite functions, ICML 2019).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from falsifier.engines.layout import Array, learnable
from falsifier.evaluation.evaluate import Evaluation
from falsifier.stl import Monitor
from falsifier.stl.formula import And, Formula, Implies, Not, Or


@dataclass(slots=True)
class Conditions:
    """The conditions of a formula."""

    formula: Formula
    parts: tuple[Formula, ...] = field(init=False)  # the distinct conditions
    _monitors: list[Monitor] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.parts = tuple(dict.fromkeys(_conditions(self.formula)))

    def values(self, evaluation: Evaluation) -> Array | None:
        """Return each condition's robustness, shape (conditions,); None if they are not known.

        All trajectories have one time grid.
        """
        trajectory, robustness = evaluation.trajectory, evaluation.robustness
        if robustness is not None and self.parts == (self.formula,):
            return learnable([robustness])
        if robustness is None or trajectory is None:
            return None
        if not self._monitors:
            self._monitors = [Monitor(part, trajectory.step, len(trajectory)) for part in self.parts]
        columns = {name: column[None] for name, column in trajectory.columns.items()}
        return learnable([monitor.batch(columns).item() for monitor in self._monitors])

    def lowest(self, low: Array, high: Array) -> Array:
        """Return the lowest robustness of the formula if the conditions lie between bounds.

        Args:
            low: lower bounds, shape (conditions, m).
            high: upper bounds, in the same way.

        Returns:
            Robustness, shape (m,); it has the sign of the formula's whatever each condition is divided by.
        """
        return _lowest(self.formula, *(dict(zip(self.parts, rows, strict=True)) for rows in (low, high)))


def _conditions(formula: Formula) -> list[Formula]:
    if isinstance(formula, (And, Or, Implies, Not)):
        return [part for child in formula.children for part in _conditions(child)]
    return [formula]


def _lowest(formula: Formula, low: Mapping[Formula, Array], high: Mapping[Formula, Array]) -> Array:
    match formula:
        case Not(operand):
            return -_lowest(operand, high, low)
        case And(left, right):
            return np.minimum(_lowest(left, low, high), _lowest(right, low, high))
        case Or(left, right):
            return np.maximum(_lowest(left, low, high), _lowest(right, low, high))
        case Implies(left, right):
            return np.maximum(-_lowest(left, high, low), _lowest(right, low, high))
    return low[formula]
