"""rtamt as an independent second monitor for the robustness at time 0.

rtamt (D. Nickovic, T. Yamaguchi, "RTAMT: Online robustness monitors from STL", ATVA 2020) silently parses
some formulas differently from what one would expect, so it never gets a formula as written. It gets a text
generated from our tree: every operator in parentheses, signals under simple aliases, times counted in samples
of one second. Where its discrete-time semantics differ from ours, the formula is rewritten:

- the compared expressions become separate columns, because rtamt's versions support different arithmetic;
- its ``until`` ignores the last sample of the left operand: ``l U r`` becomes ``l U (l and r)``;
- its ``l U[a,b] r`` takes cubic time and becomes the equivalent
  ``G[0,a-1] l and F[a,b] (l and r) and F[a,a] (l U (l and r))``;
- its ``iff`` and ``xor`` are unsigned: ``<->`` becomes two implications;
- its ``G[a,b]`` looks through the whole window at every sample, and only time 0 is asked for: a ``G[a,b] f``
  that is not inside another temporal operator becomes ``G (not inside or f)`` and ``F[a,b] f`` becomes
  ``F (inside and f)``, with a column ``inside`` that is infinite in the window and minus infinite outside.
"""

import sys
import types
import typing
import warnings
from dataclasses import dataclass, field
from math import copysign, inf
from typing import Any

import numpy as np

from falsifier.core.literals import shortest
from falsifier.core.trajectory import Trajectory
from falsifier.errors import MonitorError
from falsifier.stl import formula as stl
from falsifier.stl.compiler import window_samples
from falsifier.stl.expression import Expression, Number
from falsifier.stl.margins import ON_LIMIT

# Larger than any margin.
_STAND_IN = 1e308


def robustness(formula: stl.Formula, trajectory: Trajectory) -> float:
    """Return the robustness at time 0 computed by rtamt; exactly on the limit, its sign says what is true.

    Raises:
        FormulaError: if the bound of a window is not a multiple of the trajectory's step.
        MonitorError: if the trajectory is too short or lacks a signal, a comparison has no finite value at a
            time at which it matters, or rtamt fails.
    """
    end, needed = float(trajectory.times[-1]), formula.horizon(trajectory.step)
    # In samples, as each bound may be off its sample by a little, and their sum by more.
    if round(needed / (trajectory.step or 1.0)) >= len(trajectory):
        raise MonitorError(f"the formula needs {needed:.10g} s, the trajectory ends at {end:.10g} s")
    translation = _Translation(trajectory)
    found = _evaluate(formula, translation)
    # rtamt needs a margin at all times: where there is none, it must not matter which one it gets.
    if translation.undefined and found != _evaluate(formula, _Translation(trajectory, stand_in=-_STAND_IN)):
        raise MonitorError(translation.undefined)
    if found == 0:  # on the limit, it depends on the comparisons: rtamt evaluates their truth, 1 or -1
        return copysign(ON_LIMIT, _evaluate(formula, _Translation(trajectory, of_truth=True)))
    return found


@dataclass(slots=True)
class _Translation:
    """Text for rtamt and the columns that it refers to."""

    trajectory: Trajectory
    of_truth: bool = False
    stand_in: float = _STAND_IN  # for margins that are not finite
    undefined: str = ""  # which one is not, and when, in words
    columns: dict[str, list[float]] = field(default_factory=dict)
    aliases: dict[Expression, str] = field(default_factory=dict)

    def text(self, f: stl.Formula, *, at_start: bool = False) -> str:
        """Return the text of a formula, in parentheses; ``at_start``: only its value at time 0 counts."""
        match f:
            case stl.Predicate() if self.of_truth:
                return f"({self.truth(f)} >= 0)"
            case stl.Predicate() if margins := self.stood_in(f):
                return f"({margins} >= 0)"
            case stl.Predicate("!=", left, right):
                return f"(not ({self.side(left)} == {self.side(right)}))"
            case stl.Predicate(operator, left, right):
                return f"({self.side(left)} {operator} {self.side(right)})"
            case stl.Not(operand):
                return f"(not {self.text(operand, at_start=at_start)})"
            case stl.Iff(left, right):
                return self.text(
                    stl.And(stl.Implies(left, right), stl.Implies(right, left)), at_start=at_start
                )
            case stl.And(left, right) | stl.Or(left, right) | stl.Implies(left, right):
                return (
                    f"({self.text(left, at_start=at_start)} {f.sign} {self.text(right, at_start=at_start)})"
                )
            case stl.Always(operand, window) if window is not None and at_start:
                return f"(always ((0 >= {self.inside(window)}) or {self.text(operand)}))"
            case stl.Eventually(operand, window) if window is not None and at_start:
                return f"(eventually (({self.inside(window)} >= 0) and {self.text(operand)}))"
            case stl.Next(operand) | stl.Always(operand) | stl.Eventually(operand):
                name = {stl.Next: "next", stl.Always: "always", stl.Eventually: "eventually"}[type(f)]
                bounds = "[{},{}]".format(*self.samples(f.window)) if f.window else ""
                return f"({name}{bounds} {self.text(operand)})"
            case stl.Until(left, right, window):
                return self.until(left, right, window)
        raise TypeError(f"not a formula: {f!r}")

    def until(self, left: stl.Formula, right: stl.Formula, window: stl.Window | None) -> str:
        """Return the text of an until whose left operand includes the last sample."""
        text, both = self.text(left), self.text(stl.And(left, right))
        until = f"({text} until {both})"
        if window is None:
            return until
        start, end = self.samples(window)
        within = f"((eventually[{start},{end}] {both}) and (eventually[{start},{start}] {until}))"
        return f"((always[0,{start - 1}] {text}) and {within})" if start else within

    def samples(self, window: stl.Window) -> tuple[int, int]:
        return window_samples(window, self.trajectory.step or 1.0)

    def column(self, values: list[float]) -> str:
        """Add a column and return its alias."""
        alias = f"v{len(self.columns)}"
        self.columns[alias] = values
        return alias

    def inside(self, window: stl.Window) -> str:
        """Return the alias of a column that is infinite in a window and minus infinite outside."""
        start, end = self.samples(window)
        return self.column([inf if start <= k <= end else -inf for k in range(len(self.trajectory))])

    def side(self, expression: Expression) -> str:
        """Return the text of a compared expression: a number, or the alias of its column."""
        if isinstance(expression, Number):
            return shortest(expression.value)
        if expression not in self.aliases:
            known = {name: self.trajectory[name] for name in expression.signals}
            values = np.broadcast_to(expression.evaluate(known), self.trajectory.times.shape)
            self.aliases[expression] = self.column(values.tolist())
        return self.aliases[expression]

    def stood_in(self, predicate: stl.Predicate) -> str:
        """Return the alias of a column of a predicate's margins if some need the stand-in; else nothing."""
        known = {name: self.trajectory[name] for name in predicate.signals}
        with np.errstate(all="ignore"):
            margins = np.broadcast_to(predicate.margin(known), self.trajectory.times.shape)
        is_finite = np.isfinite(margins)
        if is_finite.all():
            return ""
        self.undefined = f"{predicate} has no finite value at {self.trajectory.times[is_finite.argmin()]:g} s"
        return self.column(np.where(is_finite, margins, self.stand_in).tolist())

    def truth(self, predicate: stl.Predicate) -> str:
        """Return the alias of a column that is 1 where a predicate is true and -1 where it is false."""
        true = np.broadcast_to(predicate.holds(self.trajectory.columns), self.trajectory.times.shape)
        return self.column(np.where(true, 1.0, -1.0).tolist())


def _evaluate(formula: stl.Formula, translation: _Translation) -> float:
    text = translation.text(formula, at_start=True)
    length = len(translation.trajectory)
    columns = translation.columns or {"v0": [0.0] * length}
    if length == 1:  # rtamt fails on one sample; repeating it does not change the value at time 0
        columns = {name: values * 2 for name, values in columns.items()}
    specification = _rtamt().StlDiscreteTimeOfflineSpecification()
    for name in columns:
        specification.declare_var(name, "float")
    specification.spec = text
    specification.parse()
    if len(specification.ast.specs) != 1:
        raise MonitorError(f"rtamt parsed {len(specification.ast.specs)} formulas instead of one in {text}")
    samples = len(next(iter(columns.values())))
    values = specification.evaluate({"time": [float(k) for k in range(samples)], **columns})
    return float(values[0][1])


def _rtamt() -> Any:
    if sys.version_info >= (3, 13) and "typing.io" not in sys.modules:
        # rtamt needs an antlr runtime that imports typing.io, which Python 3.13 removed.
        shim = types.ModuleType("typing.io")
        vars(shim)["TextIO"] = typing.TextIO
        sys.modules["typing.io"] = shim
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the same import, on older Pythons
        import rtamt

    return rtamt
