"""Compiler from a formula to a program for one time grid.

First pass (``demand``): determine at which samples each sub-formula and expression is needed. Second pass
(``location``): assign each a location in one flat buffer and emit the steps that fill it. Samples that are
not needed are not computed; a part that occurs twice in a formula is computed once.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from falsifier.core.literals import shortest
from falsifier.errors import FormulaError
from falsifier.stl import expression, formula as stl, program as op
from falsifier.stl.margins import on_limit
from falsifier.stl.program import CompiledPart, Location, Program

_BOUND_TOLERANCE = 1e-6  # as a fraction of one sampling step
# Of numbers that are all floating-point, power is the faster one.
_ARITHMETIC = expression.OPERATORS | {"^": np.power}
_NEGATION = op.scaled(-1.0)
_CONNECTIVES: dict[type[stl.Formula], op.Function] = {
    stl.Not: _NEGATION,
    stl.And: np.minimum,
    stl.Or: np.maximum,
}


def compile_formula(formula: stl.Formula, *, step: float, samples: int, last: int = 0) -> Program:
    """Compile a formula for trajectories on one time grid.

    The sampling step is in s; the robustness is needed at the samples from 0 to ``last``.

    Raises:
        FormulaError: naming what ends after the trajectory, is no multiple of the step or no finite number.
    """
    compiler = _Compiler(formula, step, samples, size=len(formula.signals) * samples)
    compiler.demand(formula, 0, last)
    compiler.location(formula)
    return Program(
        compiler.part(formula, 0, last),
        formula.signals,
        step,
        samples,
        tuple(compiler.steps),
        compiler.size,
        compiler.checked,
    )


def window_samples(window: stl.Window, step: float) -> tuple[int, int]:
    """Return the bounds of a window in samples; FormulaError if a bound is not a multiple of the step."""
    start, end = round(window.start / step), round(window.end / step)
    for bound, nearest in ((window.start, start), (window.end, end)):
        if abs(bound / step - nearest) > _BOUND_TOLERANCE:
            raise FormulaError(
                f"the bound {shortest(bound)} s of the window {window} is not a multiple of the sampling "
                f"step {shortest(step)} s; the nearest multiple is "
                f"{shortest(round(nearest * step, 12))} s"
            )
    return start, end


@dataclass(slots=True)
class _Compiler:
    formula: stl.Formula
    step: float
    samples: int
    needs: dict[stl.Node, tuple[int, int]] = field(default_factory=dict)
    # The same in each place where a part stands: samples between them do not matter.
    spans: dict[stl.Node, set[tuple[int, int]]] = field(default_factory=dict)
    locations: dict[stl.Node, Location] = field(default_factory=dict)
    steps: list[op.Operation] = field(default_factory=list)
    checked: dict[int, tuple[stl.Predicate, Location]] = field(default_factory=dict)
    size: int = 0

    # -- at which samples each part is needed ------------------------------------------------------------

    def demand(self, node: stl.Node, first: int, last: int) -> None:
        """Record that a part, and everything below it, is needed at the samples from first to last."""
        if last >= self.samples:
            self._fail_past_end(node, last)
        seen = self.needs.get(node, (first, last))
        self.needs[node] = (min(seen[0], first), max(seen[1], last))
        self.spans.setdefault(node, set()).add((first, last))
        for part, begin, end in self._below(node, first, last):
            self.demand(part, begin, end)

    def _below(self, node: stl.Node, first: int, last: int) -> Iterator[tuple[stl.Node, int, int]]:
        """Yield what is directly below a part, with the first and last sample at which it is needed there."""
        start = end = int(isinstance(node, stl.Next))
        if isinstance(node, stl.Temporal) and node.window is None:
            end = self.samples - 1 - last
        elif isinstance(node, stl.Temporal) and node.window:
            # First, so that no bound after the end of the trajectory is suggested as the nearest multiple.
            beyond = last + round(node.window.end / self.step)
            if beyond >= self.samples:
                self._fail_past_end(node, beyond)
            start, end = window_samples(node.window, self.step)
        for number, part in enumerate(stl.parts_of(node)):
            is_left = isinstance(node, stl.Until) and number == 0  # needed from now on
            yield part, first if is_left else first + start, last + end

    def _fail_past_end(self, node: stl.Node, last: int) -> None:
        end = (self.samples - 1) * self.step
        window = node.window if isinstance(node, stl.Formula) else None
        what = f"the window {window} of {node}" if window else f"{node}"
        hint = "shorten the windows or simulate longer"
        if any(isinstance(f, stl.Temporal) and f.window is None for f in self.formula.walk()):
            hint += "; an operator without a window extends to the stop time: give it one that ends earlier"
        raise FormulaError(
            f"{what} needs values up to {shortest(round(last * self.step, 9))} s, but the trajectory ends "
            f"at {shortest(round(end, 9))} s; {hint}"
        )

    # -- the steps ---------------------------------------------------------------------------------------

    def location(self, node: stl.Node) -> Location:
        """Emit the steps of a part, only once, and return the location of its values."""
        if node not in self.locations:
            first, last = self.needs[node]
            if isinstance(node, expression.Expression):
                self.locations[node] = self._expression(node, first, last)
            else:
                self.locations[node] = self._formula(node, first, last)
        return self.locations[node]

    def _emit(
        self,
        function: op.Function,
        first: int,
        last: int,
        *operands: Location,
        ahead: tuple[int, int] = (0, 0),
    ) -> Location:
        """Append one step and return the location of its result.

        ``first`` and ``last`` are samples of the result and of its operands; those of the operands are later
        by ``ahead`` samples, each.
        """
        start, end = first + ahead[0], last + ahead[1] + 1
        reads = [slice(location.at(start), location.at(end)) for location in operands]
        result = Location(self.size - first, first, last)
        self.size = result.at(last + 1)
        self.steps.append(op.calculating(function, slice(result.at(first), self.size), *reads))
        return result

    def _expression(self, node: expression.Expression, first: int, last: int) -> Location:
        if isinstance(node, expression.Name):
            return Location(self.formula.signals.index(node.name) * self.samples, 0, self.samples - 1)
        if not node.signals:
            return self._emit(op.constant(_constant(node)), first, last)
        match node:
            case expression.Arithmetic():
                return self._arithmetic(node, first, last)
            case expression.Negative(operand):
                return self._emit(_NEGATION, first, last, self.location(operand))
            case expression.Call(name, operands):
                function = expression.FUNCTIONS_OF[name]
                sides = [self.location(operand) for operand in operands]
                result = self._emit(function, first, last, *sides[:2])
                for other in sides[2:]:
                    result = self._emit(function, first, last, result, other)
                return result
        raise TypeError(f"not an expression: {node!r}")

    def _arithmetic(self, node: expression.Arithmetic, first: int, last: int) -> Location:
        left, right, operator = node.left, node.right, node.operator
        if operator == "^" and not right.signals and _constant(right) == 2:
            # One multiplication is much faster than pow, and squares are frequent.
            base = self.location(left)
            return self._emit(np.multiply, first, last, base, base)
        if operator in "+-*" and not (left.signals and right.signals):
            c = _constant(left if right.signals else right)
            factor, offset = {"+": (1.0, c), "-": (-1.0, c), "*": (c, 0.0)}[operator]
            if operator == "-" and left.signals:
                factor, offset = 1.0, -c
            return self._emit(
                op.scaled(factor, offset), first, last, self.location(left if left.signals else right)
            )
        return self._emit(_ARITHMETIC[operator], first, last, self.location(left), self.location(right))

    def _predicate(self, node: stl.Predicate, first: int, last: int) -> Location:
        left, right = (node.right, node.left) if node.operator in ("<", "<=") else (node.left, node.right)
        margin = self._expression(expression.Arithmetic("-", left, right), first, last)
        if node.operator in ("==", "!="):
            margin = self._emit(np.absolute, first, last, margin)
        if node.operator == "==":
            margin = self._emit(_NEGATION, first, last, margin)
        self.checked[len(self.steps)] = node, margin
        idle = np.ones(last + 1 - first, np.bool_)
        for begin, end in self.spans[node]:
            idle[begin - first : end + 1 - first] = False
        margins = slice(margin.at(first), margin.at(last + 1))
        self.steps.append(op.checking(margins, on_limit(node.operator), idle))
        return margin

    def _formula(self, node: stl.Formula, first: int, last: int) -> Location:
        if isinstance(node, stl.Predicate):
            return self._predicate(node, first, last)
        parts = [self.location(child) for child in node.children]
        match node:
            case stl.Next():
                return parts[0].later(1)
            case stl.Always() | stl.Eventually():
                return self._window(node, parts[0], first, last)
            case stl.Until():
                return self._until(node, parts[0], parts[1], first, last)
            case stl.Implies():
                return self._implication(parts[0], parts[1], first, last)
            case stl.Iff():
                forth = self._implication(parts[0], parts[1], first, last)
                back = self._implication(parts[1], parts[0], first, last)
                return self._emit(np.minimum, first, last, forth, back)
        return self._emit(_CONNECTIVES[type(node)], first, last, *parts)

    def _implication(self, left: Location, right: Location, first: int, last: int) -> Location:
        return self._emit(np.maximum, first, last, self._emit(_NEGATION, first, last, left), right)

    def _window(self, node: stl.Always | stl.Eventually, below: Location, first: int, last: int) -> Location:
        extreme, end = np.minimum if isinstance(node, stl.Always) else np.maximum, self.samples - 1
        if node.window is None and first < last:
            return self._emit(op.rest(extreme), first, end, below)
        ahead = window_samples(node.window, self.step) if node.window else (0, end - first)
        return self._emit(op.window(extreme), first, last, below, ahead=ahead)

    def _until(self, node: stl.Until, left: Location, right: Location, first: int, last: int) -> Location:
        """Emit ``l U[a,b] r`` as ``G[0,a-1] l and F[a,b] (l and r) and F[a,a] (l U (l and r))``, in samples.

        The three parts together are equivalent to the bounded until, and each takes linear time. The
        unbounded until in the last part ensures that l holds from a until r does; the middle bounds when.
        """
        ahead = window_samples(node.window, self.step) if node.window else (0, self.samples - 1 - last)
        begin, end = first + ahead[0], last + ahead[1]
        both = self._emit(np.minimum, begin, end, left, right)
        until = self._emit(op.until, begin, end, left, both)
        if node.window is None:
            return until
        soon = self._emit(op.window(np.maximum), first, last, both, ahead=ahead)
        result = self._emit(np.minimum, first, last, until.later(ahead[0]), soon)
        if begin > first:
            before = self._emit(op.window(np.minimum), first, last, left, ahead=(0, ahead[0] - 1))
            result = self._emit(np.minimum, first, last, before, result)
        return result

    def part(self, node: stl.Formula, first: int, last: int) -> CompiledPart:
        """Return a sub-formula that is needed here at these samples, its location and all parts below it."""
        window: tuple[int, int | None] | None = None
        if isinstance(node, stl.Temporal):
            window = window_samples(node.window, self.step) if node.window else (0, None)
        below = self._below(node, first, last)
        children = tuple(self.part(f, a, b) for f, a, b in below if isinstance(f, stl.Formula))
        location = Location(self.locations[node].base, first, last)
        return CompiledPart(node, str(node), location, window, self.samples, children)


def _constant(node: expression.Expression) -> float:
    value = float(node.evaluate({}))
    if not math.isfinite(value):
        raise FormulaError(f"the constant {node} has no finite value; write a number or correct it")
    return value
