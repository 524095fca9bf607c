"""Compiler from a formula to a program for one time grid.

First pass (``demand``): determine at which samples each sub-formula and expression is needed. Second pass
(``place``): assign each a place in one flat buffer and emit the steps that fill it. Samples that are not
needed are not computed; a part that occurs twice in a formula is computed once.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from falsifier.errors import FormulaError
from falsifier.stl import program as op
from falsifier.stl.expression import (
    FUNCTIONS_OF,
    OPERATORS,
    Arithmetic,
    Call,
    Expression,
    Name,
    Negative,
    number_text,
)
from falsifier.stl.formula import (
    Always,
    And,
    Eventually,
    Formula,
    Implies,
    Next,
    Not,
    Or,
    Predicate,
    Until,
    Window,
)
from falsifier.stl.margins import on_limit
from falsifier.stl.program import Part, Place, Program

_BOUND_TOLERANCE = 1e-6  # as a fraction of one sampling step
# Of numbers that are all floating-point, power is the faster one.
_ARITHMETIC = OPERATORS | {"^": np.power}
_NEGATION = op.scaled(-1.0)
Node = Formula | Expression


def compile_formula(formula: Formula, *, step: float, samples: int, first: int = 0, last: int = 0) -> Program:
    """Compile a formula for trajectories on one time grid.

    Args:
        formula: the formula.
        step: sampling step in s.
        samples: number of samples of a trajectory.
        first: first sample at which the formula's robustness is needed.
        last: last sample at which it is needed.

    Raises:
        FormulaError: naming the window that ends after the trajectory or is not a multiple of the step.
    """
    compiler = _Compiler(formula, step, samples, size=len(formula.signals) * samples)
    compiler.demand(formula, first, last)
    compiler.place(formula)
    return compiler.program()


def window_samples(window: Window, step: float) -> tuple[int, int]:
    """Return the bounds of a window in samples.

    Raises:
        FormulaError: if a bound is not a multiple of the step.
    """
    start, end = (_bound_samples(bound, window, step) for bound in (window.start, window.end))
    return start, end


def _bound_samples(bound: float, window: Window, step: float) -> int:
    nearest = round(bound / step)
    if abs(bound / step - nearest) > _BOUND_TOLERANCE:
        raise FormulaError(
            f"the bound {number_text(bound)} s of the window {window} is not a multiple of the sampling step "
            f"{number_text(step)} s; the nearest multiple is {number_text(round(nearest * step, 12))} s"
        )
    return nearest


@dataclass(slots=True)
class _Compiler:
    formula: Formula
    step: float
    samples: int
    needs: dict[Node, tuple[int, int]] = field(default_factory=dict)
    places: dict[Node, Place] = field(default_factory=dict)
    steps: list[op.Operation] = field(default_factory=list)
    checked: dict[int, tuple[Predicate, Place]] = field(default_factory=dict)
    size: int = 0

    # -- at which samples each part is needed ------------------------------------------------------------

    def demand(self, node: Node, first: int, last: int) -> None:
        """Record that a part, and everything below it, is needed at the samples from first to last."""
        if last >= self.samples:
            self._fail_past_end(node, last)
        reach = (first, last)
        if isinstance(node, Always | Eventually | Until) and node.window is None:
            reach = (first, self.samples - 1)
        elif isinstance(node, Always | Eventually | Until) and node.window:
            # First, so that no bound after the end of the trajectory is suggested as the nearest multiple.
            beyond = last + round(node.window.end / self.step)
            if beyond >= self.samples:
                self._fail_past_end(node, beyond)
            start, end = window_samples(node.window, self.step)
            reach = (first if isinstance(node, Until) else first + start, last + end)
        elif isinstance(node, Next):
            reach = (first + 1, last + 1)
        seen = self.needs.get(node, (first, last))
        self.needs[node] = (min(seen[0], first), max(seen[1], last))
        for part in _parts(node):
            self.demand(part, *reach)

    def _fail_past_end(self, node: Node, last: int) -> None:
        end = (self.samples - 1) * self.step
        window = getattr(node, "window", None)
        what = f"the window {window} of {node}" if window else f"{node}"
        hint = "shorten the windows or simulate longer"
        if any(isinstance(f, Always | Eventually | Until) and f.window is None for f in self.formula.walk()):
            hint += "; an operator without a window extends to the stop time: give it one that ends earlier"
        raise FormulaError(
            f"{what} needs values up to {number_text(round(last * self.step, 9))} s, but the trajectory ends "
            f"at {number_text(round(end, 9))} s; {hint}"
        )

    # -- the steps ---------------------------------------------------------------------------------------

    def place(self, node: Node) -> Place:
        """Emit the steps of a part, only once, and return the place of its values."""
        if node not in self.places:
            if isinstance(node, Expression):
                self.places[node] = self._expression(node)
            else:
                self.places[node] = self._formula(node)
        return self.places[node]

    def _emit(self, function: op.Function, length: int, *operands: int, width: int = 0) -> int:
        """Append one step and return the offset of its result.

        Args:
            function: what it calculates.
            length: length of its result and of its operands.
            operands: their offsets.
            width: by how much the first one is longer.
        """
        reads = [slice(offset, offset + length) for offset in operands]
        if width:
            reads[0] = slice(operands[0], operands[0] + length + width)
        out = slice(self.size, self.size + length)
        self.steps.append(op.calculating(function, out, *reads))
        self.size += length
        return out.start

    def _expression(self, node: Expression) -> Place:
        first, last = self.needs[node]
        n = last - first + 1
        if isinstance(node, Name):
            return Place(self.formula.signals.index(node.name) * self.samples, 0, self.samples - 1)
        if not node.signals:
            return Place(self._emit(op.constant(_constant(node)), n) - first, first, last)
        match node:
            case Arithmetic():
                offset = self._arithmetic(node, first, n)
            case Negative(operand):
                offset = self._emit(_NEGATION, n, self.place(operand).at(first))
            case Call(name):
                function, sides = FUNCTIONS_OF[name], [self.place(o).at(first) for o in node.operands]
                offset = self._emit(function, n, *sides[:2])
                for other in sides[2:]:
                    offset = self._emit(function, n, offset, other)
            case _:
                raise TypeError(f"not an expression: {node!r}")
        return Place(offset - first, first, last)

    def _arithmetic(self, node: Arithmetic, first: int, n: int) -> int:
        left, right, operator = node.left, node.right, node.operator
        if operator == "^" and not right.signals and _constant(right) == 2:
            # One multiplication is much faster than pow, and squares are frequent.
            base = self.place(left).at(first)
            return self._emit(np.multiply, n, base, base)
        if not right.signals and operator in "+-*":
            c = _constant(right)
            scale = op.scaled(c) if operator == "*" else op.scaled(1.0, c if operator == "+" else -c)
            return self._emit(scale, n, self.place(left).at(first))
        if not left.signals and operator in "+-*":
            c = _constant(left)
            scale = op.scaled(c) if operator == "*" else op.scaled(1.0 if operator == "+" else -1.0, c)
            return self._emit(scale, n, self.place(right).at(first))
        return self._emit(_ARITHMETIC[operator], n, self.place(left).at(first), self.place(right).at(first))

    def _predicate(self, node: Predicate, first: int, n: int) -> int:
        left, right = (node.right, node.left) if node.operator in ("<", "<=") else (node.left, node.right)
        difference = Arithmetic("-", left, right)
        if difference.signals:
            offset = self._arithmetic(difference, first, n)
        else:
            offset = self._emit(op.constant(_constant(difference)), n)
        if node.operator in ("==", "!="):
            offset = self._emit(np.absolute, n, offset)
        if node.operator == "==":
            offset = self._emit(_NEGATION, n, offset)
        self.checked[len(self.steps)] = node, Place(offset - first, first, first + n - 1)
        self.steps.append(op.checking(slice(offset, offset + n), on_limit(node.operator)))
        return offset

    def _formula(self, node: Formula) -> Place:
        first, last = self.needs[node]
        n = last - first + 1
        if isinstance(node, Predicate):
            return Place(self._predicate(node, first, n) - first, first, last)
        if isinstance(node, Next):
            below = self.place(node.operand)
            return Place(below.base + 1, first, last)
        if isinstance(node, Always | Eventually):
            return self._window(node, first, last)
        if isinstance(node, Until):
            return self._until(node, first, last)
        sides = [self.place(child).at(first) for child in node.children]
        if isinstance(node, Not):
            offset = self._emit(_NEGATION, n, *sides)
        elif isinstance(node, And):
            offset = self._emit(np.minimum, n, *sides)
        elif isinstance(node, Or):
            offset = self._emit(np.maximum, n, *sides)
        elif isinstance(node, Implies):
            offset = self._implication(sides[0], sides[1], n)
        else:
            both = self._implication(sides[0], sides[1], n), self._implication(sides[1], sides[0], n)
            offset = self._emit(np.minimum, n, *both)
        return Place(offset - first, first, last)

    def _implication(self, left: int, right: int, n: int) -> int:
        return self._emit(np.maximum, n, self._emit(_NEGATION, n, left), right)

    def _window(self, node: Always | Eventually, first: int, last: int) -> Place:
        below, extreme = self.place(node.operand), np.minimum if isinstance(node, Always) else np.maximum
        if node.window is None and first < last:
            last = self.samples - 1
            offset = self._emit(op.rest(extreme), last - first + 1, below.at(first))
            return Place(offset - first, first, last)
        start, end = window_samples(node.window, self.step) if node.window else (0, self.samples - 1 - first)
        offset = self._emit(op.window(extreme), last - first + 1, below.at(first + start), width=end - start)
        return Place(offset - first, first, last)

    def _until(self, node: Until, first: int, last: int) -> Place:
        """Emit ``l U[a,b] r`` as ``G[0,a-1] l and F[a,b] (l and r) and F[a,a] (l U (l and r))``, in samples.

        The three parts together are equivalent to the bounded until, and each takes linear time. The
        unbounded until in the last part ensures that l holds from a until r does; the middle part bounds
        when.
        """
        left, right = (self.place(child) for child in node.children)
        if node.window is None:
            n = self.samples - first
            both = self._emit(np.minimum, n, left.at(first), right.at(first))
            offset = self._emit(op.until, n, left.at(first), both)
            return Place(offset - first, first, self.samples - 1)
        n = last - first + 1
        start, end = window_samples(node.window, self.step)
        begin, width = first + start, end - start
        both = self._emit(np.minimum, n + width, left.at(begin), right.at(begin))
        until = self._emit(op.until, n + width, left.at(begin), both)
        soon = self._emit(op.window(np.maximum), n, both, width=width)
        offset = self._emit(np.minimum, n, until, soon)
        if start > 0:
            before = self._emit(op.window(np.minimum), n, left.at(first), width=start - 1)
            offset = self._emit(np.minimum, n, before, offset)
        return Place(offset - first, first, last)

    def part(self, node: Formula) -> Part:
        """Return a sub-formula with its place and all parts below it."""
        window: tuple[int, int | None] | None = None
        if isinstance(node, Always | Eventually | Until):
            window = window_samples(node.window, self.step) if node.window else (0, None)
        children = tuple(self.part(child) for child in node.children)
        return Part(node, str(node), self.places[node], window, self.samples, children)

    def program(self) -> Program:
        """Return the compiled program; ``place`` must have been called before."""
        return Program(
            self.part(self.formula),
            self.formula.signals,
            self.step,
            self.samples,
            np.arange(self.samples, dtype=np.float64) * self.step,
            tuple(self.steps),
            self.size,
            self.checked,
        )


def _constant(node: Expression) -> float:
    value = float(node.evaluate({}))
    if not math.isfinite(value):
        raise FormulaError(
            f"the constant {node} has no finite value; write a number or correct the expression"
        )
    return value


def _parts(node: Node) -> tuple[Node, ...]:
    if isinstance(node, Expression):
        return node.operands
    return (node.left, node.right) if isinstance(node, Predicate) else node.children
