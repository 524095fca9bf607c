"""Formulas of Signal Temporal Logic as immutable trees.

``falsifier.stl.parse`` builds them from text; ``str(formula)`` parses back to the same tree. To inspect one,
use ``formula.walk()``, ``formula.children`` and ``formula.predicates``.

``true`` and ``false`` are replaced when a formula is read, by an equivalent one without them. Their
robustness is infinite by definition, with either sign. A minimum or maximum with an infinite value is the
other value or infinite itself, so that every constant either disappears or spreads to the formula around it.
What remains has the same robustness and the same critical time, and finite values in all its parts.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, ClassVar, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from falsifier.core.literals import shortest
from falsifier.stl.expression import SUM, Expression, Name, Number, embraced

Comparison = Literal["<", "<=", ">", ">=", "==", "!="]

# Precedence levels, lowest first; those of expressions (expression.py) follow.
EQUIVALENCE, IMPLICATION, DISJUNCTION, CONJUNCTION, UNTIL, PREFIX, COMPARISON = range(7)
# What holds if a comparison does not; and what holds if its sides are exchanged.
OPPOSITE: dict[Comparison, Comparison] = {
    "<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "==",
}  # fmt: skip
MIRRORED: dict[Comparison, Comparison] = {
    "<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!=",
}  # fmt: skip
_COMPARISONS: dict[Comparison, np.ufunc] = {
    "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal,
    "==": np.equal, "!=": np.not_equal,
}  # fmt: skip
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Window:
    """The closed time interval in s of a temporal operator, relative to the time at which it is evaluated."""

    start: float
    end: float

    def __str__(self) -> str:
        return f"[{shortest(self.start)},{shortest(self.end)}]"


class Formula:
    """A formula of Signal Temporal Logic; base of the classes below."""

    __slots__ = ()
    binding: ClassVar[int] = PREFIX

    def __repr__(self) -> str:
        return f"parse({str(self)!r})"

    @property
    def children(self) -> tuple["Formula", ...]:
        """Formulas directly below this one."""
        return ()

    @property
    def window(self) -> Window | None:
        """Window of a temporal operator; None without one."""
        return None

    def walk(self) -> Iterator["Formula"]:
        """Yield this formula and all below it, from left to right."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def predicates(self) -> tuple["Predicate", ...]:
        """Distinct predicates in order of first appearance."""
        return tuple(dict.fromkeys(f for f in self.walk() if isinstance(f, Predicate)))

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals in order of first appearance."""
        return tuple(dict.fromkeys(n for p in self.predicates for side in p.sides for n in side.signals))

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """Compared expressions other than single signals and numbers: derived signals, worth plotting.

        ``expression.evaluate(trajectory.columns)`` returns the values on a trajectory.
        """
        sides = dict.fromkeys(side for p in self.predicates for side in p.sides)
        return tuple(side for side in sides if side.signals and not isinstance(side, Name))

    @property
    def windows(self) -> tuple[Window, ...]:
        """Windows of the temporal operators, from left to right; without those that have none."""
        return tuple(f.window for f in self.walk() if f.window is not None)

    def horizon(self, step: float = 0.0) -> float:
        """Return how long in s a trajectory must be at least for the formula to be evaluated at time 0.

        An operator without a window extends to the end of any trajectory, and adds nothing.

        Args:
            step: sampling step in s; each ``X`` adds one.
        """
        own = step if isinstance(self, Next) else self.window.end if self.window else 0.0
        return own + max((child.horizon(step) for child in self.children), default=0.0)


@dataclass(frozen=True, slots=True, repr=False)
class Predicate(Formula):
    """A comparison of two expressions; its robustness is the signed margin, 0 if both are equal."""

    operator: Comparison
    left: Expression
    right: Expression
    binding: ClassVar[int] = COMPARISON

    @property
    def sides(self) -> tuple[Expression, Expression]:
        """The compared expressions."""
        return self.left, self.right

    def margin(self, columns: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the signed margin, in the shape of the given columns; 0 where both sides are equal."""
        left, right = self.left.evaluate(columns), self.right.evaluate(columns)
        if self.operator in ("<", "<="):
            return np.asarray(right - left)
        if self.operator in (">", ">="):
            return np.asarray(left - right)
        distance = np.asarray(np.abs(left - right))
        return -distance if self.operator == "==" else distance

    def holds(self, columns: Mapping[str, Any]) -> NDArray[np.bool_]:
        """Return where it is true, in the shape of the given columns."""
        compare = _COMPARISONS[self.operator]
        return np.asarray(compare(self.left.evaluate(columns), self.right.evaluate(columns)))

    def __str__(self) -> str:
        return f"{embraced(self.left, SUM)} {self.operator} {embraced(self.right, SUM)}"


@dataclass(frozen=True, slots=True, repr=False)
class Flag(Predicate):
    """A Boolean signal as a formula: ``b`` alone means ``b >= 0.5``."""

    @classmethod
    def of(cls, signal: Name) -> "Flag":
        """Return the formula that a signal is true."""
        return cls(">=", signal, Number(0.5))

    def __str__(self) -> str:
        return str(self.left)


class Bare(Predicate):
    """A signal alone that is no Boolean: compared with 0.5, too, and its text says so."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, repr=False)
class _Unary(Formula):
    operand: Formula
    sign: ClassVar[str]

    @property
    def children(self) -> tuple[Formula, ...]:
        """The operand."""
        return (self.operand,)

    def __str__(self) -> str:
        return f"{self.sign}{self.window or ''} {_prefixed(self.operand)}"


class Not(_Unary):
    """Negation."""

    __slots__ = ()
    sign: ClassVar[str] = "not"


class Next(_Unary):
    """The operand holds at the next recorded time."""

    __slots__ = ()
    sign: ClassVar[str] = "X"


@dataclass(frozen=True, slots=True, repr=False)
class _Windowed(_Unary):
    window: Window | None = None


class Always(_Windowed):
    """The operand holds throughout the window; without a window, to the end of the trajectory."""

    __slots__ = ()
    sign: ClassVar[str] = "G"


class Eventually(_Windowed):
    """The operand holds at some time in the window; without a window, before the trajectory ends."""

    __slots__ = ()
    sign: ClassVar[str] = "F"


@dataclass(frozen=True, slots=True, repr=False)
class _Binary(Formula):
    left: Formula
    right: Formula
    sign: ClassVar[str]

    @property
    def children(self) -> tuple[Formula, ...]:
        """Left and right operand."""
        return (self.left, self.right)

    def __str__(self) -> str:
        is_chain = isinstance(self, And | Or)
        least = (self.binding, self.binding + 1) if is_chain else (PREFIX, PREFIX)
        return f"{embraced(self.left, least[0])} {self.sign} {embraced(self.right, least[1])}"


class And(_Binary):
    """Conjunction."""

    __slots__ = ()
    binding: ClassVar[int] = CONJUNCTION
    sign: ClassVar[str] = "and"


class Or(_Binary):
    """Disjunction."""

    __slots__ = ()
    binding: ClassVar[int] = DISJUNCTION
    sign: ClassVar[str] = "or"


class Implies(_Binary):
    """Implication, equivalent to ``not left or right``."""

    __slots__ = ()
    binding: ClassVar[int] = IMPLICATION
    sign: ClassVar[str] = "->"


class Iff(_Binary):
    """Equivalence, the conjunction of both implications."""

    __slots__ = ()
    binding: ClassVar[int] = EQUIVALENCE
    sign: ClassVar[str] = "<->"


@dataclass(frozen=True, slots=True, repr=False)
class Until(_Binary):
    """The right operand holds at some time in the window, the left one from now until then inclusive."""

    window: Window | None = None
    binding: ClassVar[int] = UNTIL

    def __str__(self) -> str:
        return f"{_prefixed(self.left)} U{self.window or ''} {_prefixed(self.right)}"


# Operators that look at all times of a window.
Temporal = Always | Eventually | Until

Node = Formula | Expression


def parts_of(node: Node) -> tuple[Node, ...]:
    """Return what is directly below a formula or expression: of a comparison, the expressions compared."""
    if isinstance(node, Expression):
        return node.operands
    return node.sides if isinstance(node, Predicate) else node.children


def negated(formula: Formula) -> Formula:
    """Return what holds if a formula does not: the opposite comparison where there is one."""
    if isinstance(formula, Not):
        return formula.operand
    if isinstance(formula, Predicate) and not isinstance(formula, Flag):
        return Predicate(OPPOSITE[formula.operator], formula.left, formula.right)
    return Not(formula)


def _prefixed(operand: Formula) -> str:
    # The grammar needs no parentheses around a predicate; they are for the reader.
    if isinstance(operand, Predicate) and not isinstance(operand, Flag):
        return f"({operand})"
    return embraced(operand, PREFIX)


def replaced(node: T, parts: Mapping[Any, Any]) -> T:
    """Return the same formula or expression with other formulas or expressions in place of these."""
    found: Any = parts.get(node, node)
    if found is not node:
        return cast(T, found)
    if isinstance(node, tuple):
        found = tuple(replaced(part, parts) for part in node)
    elif is_dataclass(node) and not isinstance(node, type):
        found = type(node)(*(replaced(getattr(node, f.name), parts) for f in fields(node)))
    return cast(T, found)


# -- true and false ------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Constant(Formula):
    """``true`` or ``false``; only the parser makes them, and no parsed formula contains one."""

    value: bool

    def __str__(self) -> str:
        return "true" if self.value else "false"


TRUE, FALSE = Constant(value=True), Constant(value=False)


def without_constants(formula: Formula) -> Formula:
    """Return an equivalent formula without constants, or a constant if the formula is always true or false.

    >>> from falsifier.stl import parse
    >>> print(parse("true U[0,5] (x >= 1) and not false"))
    F[0,5] (x >= 1)
    """
    match formula:
        case _Unary(operand):
            formula = replace(formula, operand=without_constants(operand))
        case _Binary(left, right):
            formula = replace(formula, left=without_constants(left), right=without_constants(right))
    match formula:
        case Not(Constant() as only):
            return _opposite(only)
        case Next(Constant() as only) | Always(Constant() as only) | Eventually(Constant() as only):
            return only
        case And(Constant(True), other) | And(other, Constant(True)) | Or(Constant(False), other):
            return other
        case Or(other, Constant(False)) | Implies(Constant(True), other):
            return other
        case Iff(Constant(True), other) | Iff(other, Constant(True)):
            return other
        case Iff(Constant(False), other) | Iff(other, Constant(False)) | Implies(other, Constant(False)):
            return _opposite(other)
        case And(Constant(), _) | And(_, Constant()) | Until(Constant(False), _) | Until(_, Constant(False)):
            return FALSE
        case Or(Constant(), _) | Or(_, Constant()) | Implies(Constant(), _) | Implies(_, Constant()):
            return TRUE
        case Until(Constant(), right, window):
            return right if right == TRUE else Eventually(right, window)
        case Until(left, Constant(), window):
            # The earliest time is the best one for the right operand; the left one must hold up to then.
            return Always(left, Window(0.0, window.start)) if window and window.start > 0 else left
    return formula


def _opposite(formula: Formula) -> Formula:
    if isinstance(formula, Constant):
        return FALSE if formula.value else TRUE
    return Not(formula)
