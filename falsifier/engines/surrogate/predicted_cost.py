"""What planning minimises: robustness of many predicted trajectories, with margins in comparable units.

The formula is written anew for the grid of predictions: each predicate becomes a signal of its own, its
margin divided by the margin's spread, and windows are rounded to cells. The monitor judges thousands at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.engines.layout import Array, TimeGrid, learnable
from falsifier.stl import Monitor, Verdict, formula as stl
from falsifier.stl.expression import Name, Number

Margins = list[Array]

# Maximum distance in cells of a window bound from a grid point at which it counts as that point.
_ROUNDING = 1e-6
# Margins of predicates over discrete signals only are cut to this on both sides: they have no slope.
_DISCRETE = 0.5


@dataclass(frozen=True)
class PredictedCost:
    """Robustness of trajectories on the grid, with each predicate's margin divided by its scale."""

    space: SearchSpace  # the search space, for the ranges of inputs in the formula
    grid: TimeGrid  # the grid of the predictions
    outputs: tuple[str, ...]  # names of the predicted outputs
    predicates: tuple[stl.Predicate, ...]  # distinct predicates of the formula
    discrete: tuple[bool, ...]  # whether each predicate compares only signals with few values
    scales: tuple[float, ...]  # scale of each predicate's margin
    # Values of signals that the formula names and no candidate varies: inputs kept constant.
    constants: Mapping[str, float]
    _monitor: Monitor = field(repr=False)

    @classmethod
    def of(
        cls,
        formula: stl.Formula,
        space: SearchSpace,
        grid: TimeGrid,
        outputs: Sequence[str],
        *,
        discrete: frozenset[str],
        constants: Mapping[str, float],
    ) -> "PredictedCost":
        """Return the cost for a formula, with all scales 1 until ``rescaled``."""
        predicates = formula.predicates
        # Over the predicates' margins, with windows that count cells.
        parts: dict[object, object] = {p: _signal(i) for i, p in enumerate(predicates)}
        on_grid = stl.replaced(formula, parts | {w: _in_cells(w, grid.step) for w in formula.windows})
        # Rounded windows may end beyond the grid; the last values then continue.
        samples = max(grid.cells, round(on_grid.horizon(1.0))) + 1
        return cls(
            space,
            grid,
            tuple(outputs),
            predicates,
            tuple(discrete.issuperset(p.signals) for p in predicates),
            (1.0,) * len(predicates),
            constants,
            Monitor(on_grid, 1.0, samples),
        )

    def margins(self, states: Array, inputs: Array) -> Margins:
        """Return each predicate's margin at the grid points of the horizon, shape (m, cells + 1) each.

        Args:
            states: outputs, shape (m, cells + 1, outputs).
            inputs: scaled inputs, shape (m, cells, inputs).
        """
        columns: dict[str, Any] = {name: states[..., i] for i, name in enumerate(self.outputs)}
        columns |= {name: np.full(states.shape[:2], value) for name, value in self.constants.items()}
        for j, r in enumerate(self.space.inputs):
            held = np.concatenate([inputs[:, :, j], inputs[:, -1:, j]], axis=1)
            columns[r.name] = r.at(held)
        found: Margins = []
        with np.errstate(all="ignore"):  # what is infinite is cut by ``learnable``
            for predicate, discrete in zip(self.predicates, self.discrete, strict=True):
                values = np.broadcast_to(predicate.margin(columns), states.shape[:2])
                # Undefined, such as the logarithm of a negative number, at times that do not matter.
                values = np.where(np.isnan(values), 0.0, values)
                found.append(np.clip(values, -_DISCRETE, _DISCRETE) if discrete else values)
        return found

    def cost(self, margins: Margins) -> Array:
        """Return the scaled robustness of each trajectory, shape (m,)."""
        return np.asarray(self._monitor.batch(self._columns(margins)))

    def verdicts(self, margins: Margins) -> list[Verdict]:
        """Return the verdict on each trajectory, in this cost's unit."""
        columns = self._columns(margins)
        times = np.arange(float(self._monitor.samples))
        verdicts = []
        for row in range(len(margins[0])):
            verdict = self._monitor.evaluate(Trajectory(times, {n: c[row] for n, c in columns.items()}))
            decider = next(p for i, p in enumerate(self.predicates) if verdict.predicate == str(_signal(i)))
            time = self.grid.step * min(verdict.critical_time, self.grid.cells)
            verdicts.append(Verdict(verdict.robustness, time, str(decider)))
        return verdicts

    def rescaled(self, seen: Sequence[Margins]) -> "PredictedCost":
        """Return the cost with each margin scaled by the standard deviation of its simulated values."""
        scales = []
        for i, discrete in enumerate(self.discrete):
            values = np.concatenate([margins[i] for margins in seen])
            finite = values[np.isfinite(values)]
            spread = float(np.std(finite)) if finite.size else 0.0
            scales.append(_DISCRETE if discrete else max(spread, 1e-9))
        return replace(self, scales=tuple(scales))

    def _columns(self, margins: Margins) -> dict[str, NDArray[np.float64]]:
        beyond = self._monitor.samples - self.grid.cells - 1
        return {
            f"p{i}": np.pad(learnable(m) / s, ((0, 0), (0, beyond)), mode="edge")
            for i, (m, s) in enumerate(zip(margins, self.scales, strict=True))
        }


def needs_several(formula: stl.Formula, *, negated: bool = False) -> bool:
    """Return whether a violation requires several conditions at once: the normal form has a disjunction."""
    match formula:
        case stl.Not(operand):
            return needs_several(operand, negated=not negated)
        case stl.Until() | stl.Iff():
            return True
        case stl.And(left, right) if not negated:
            return needs_several(left) or needs_several(right)
        case stl.Or(left, right) | stl.Implies(left, right) if negated:
            turned = isinstance(formula, stl.Implies)
            return needs_several(left, negated=not turned) or needs_several(right, negated=True)
        case stl.And() | stl.Or() | stl.Implies():
            return True
    return any(needs_several(child, negated=negated) for child in formula.children)


def inner_windows(formula: stl.Formula, *, nested: bool = False) -> list[float]:
    """Return the lengths in s of the windows below another temporal operator."""
    lengths = []
    if isinstance(formula, stl.Temporal):
        if nested and formula.window is not None:
            lengths.append(formula.window.end - formula.window.start)
        nested = True
    for child in formula.children:
        lengths += inner_windows(child, nested=nested)
    return lengths


def _signal(index: int) -> stl.Predicate:
    return stl.Predicate(">", Name(f"p{index}"), Number(0.0))


def _in_cells(window: stl.Window, step: float) -> stl.Window:
    if 0 < window.end < step:
        return stl.Window(1.0, 1.0)  # a window shorter than a cell is approximated by the next grid point
    first = ceil(window.start / step - _ROUNDING)
    return stl.Window(float(first), float(max(first, floor(window.end / step + _ROUNDING))))
