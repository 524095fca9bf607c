"""Formulas of Signal Temporal Logic as immutable trees.

``falsifier.stl.parse`` makes them from text and ``str(formula)`` is a text that parses to the same tree.
Engines and prompts walk them: ``formula.walk()``, ``formula.children``, ``formula.predicates``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Literal

from falsifier.stl.expression import SUM, Expression, Name, Number, embraced, number_text

Comparison = Literal["<", "<=", ">", ">=", "==", "!="]

# How tightly a form binds, from the loosest; expressions continue the ladder.
EQUIVALENCE, IMPLICATION, DISJUNCTION, CONJUNCTION, UNTIL, PREFIX, COMPARISON = range(7)


@dataclass(frozen=True, slots=True)
class Window:
    """A closed interval of times relative to where a temporal operator stands.

    Attributes:
        start: begin in s.
        end: end in s.
    """

    start: float
    end: float

    def __str__(self) -> str:
        return f"[{number_text(self.start)},{number_text(self.end)}]"


class Formula:
    """A formula of Signal Temporal Logic; the classes below are its forms."""

    __slots__ = ()
    binding: ClassVar[int] = PREFIX

    @property
    def children(self) -> tuple["Formula", ...]:
        """Formulas directly below this one."""
        return ()

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
        sides = (side for p in self.predicates for side in (p.left, p.right))
        return tuple(dict.fromkeys(name for side in sides for name in side.signals))

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """Compared expressions that are more than a signal or a number: signals of their own, for plots.

        ``expression.evaluate(trajectory.columns)`` gives one over a trajectory.
        """
        sides = dict.fromkeys(side for p in self.predicates for side in (p.left, p.right))
        return tuple(side for side in sides if side.signals and not isinstance(side, Name))

    def horizon(self, step: float = 0.0) -> float:
        """Seconds of trajectory that the value at time 0 needs at least.

        Args:
            step: sampling step in s; each ``X`` on the way needs one. An operator without a bound reaches to
                the end of the trajectory, however long that is, and needs nothing of itself.
        """
        return max((child.horizon(step) for child in self.children), default=0.0)


@dataclass(frozen=True, slots=True)
class Predicate(Formula):
    """A comparison of two expressions; its robustness is the signed margin, 0 where both are equal."""

    operator: Comparison
    left: Expression
    right: Expression
    binding: ClassVar[int] = COMPARISON

    def __str__(self) -> str:
        return f"{embraced(self.left, SUM)} {self.operator} {embraced(self.right, SUM)}"


@dataclass(frozen=True, slots=True)
class Not(Formula):
    """Negation."""

    operand: Formula

    @property
    def children(self) -> tuple[Formula, ...]:
        """The operand."""
        return (self.operand,)

    def __str__(self) -> str:
        return f"not {_prefixed(self.operand)}"


@dataclass(frozen=True, slots=True)
class And(Formula):
    """Conjunction."""

    left: Formula
    right: Formula
    binding: ClassVar[int] = CONJUNCTION

    @property
    def children(self) -> tuple[Formula, ...]:
        """Left and right operand."""
        return (self.left, self.right)

    def __str__(self) -> str:
        return f"{embraced(self.left, CONJUNCTION)} and {embraced(self.right, CONJUNCTION + 1)}"


@dataclass(frozen=True, slots=True)
class Or(Formula):
    """Disjunction."""

    left: Formula
    right: Formula
    binding: ClassVar[int] = DISJUNCTION

    @property
    def children(self) -> tuple[Formula, ...]:
        """Left and right operand."""
        return (self.left, self.right)

    def __str__(self) -> str:
        return f"{embraced(self.left, DISJUNCTION)} or {embraced(self.right, DISJUNCTION + 1)}"


@dataclass(frozen=True, slots=True)
class Implies(Formula):
    """Implication, the same as ``not left or right``."""

    left: Formula
    right: Formula
    binding: ClassVar[int] = IMPLICATION

    @property
    def children(self) -> tuple[Formula, ...]:
        """Condition and consequence."""
        return (self.left, self.right)

    def __str__(self) -> str:
        return f"{embraced(self.left, PREFIX)} -> {embraced(self.right, PREFIX)}"


@dataclass(frozen=True, slots=True)
class Iff(Formula):
    """Equivalence, the same as both implications joined by ``and``."""

    left: Formula
    right: Formula
    binding: ClassVar[int] = EQUIVALENCE

    @property
    def children(self) -> tuple[Formula, ...]:
        """Left and right operand."""
        return (self.left, self.right)

    def __str__(self) -> str:
        return f"{embraced(self.left, PREFIX)} <-> {embraced(self.right, PREFIX)}"


@dataclass(frozen=True, slots=True)
class Always(Formula):
    """The operand holds throughout the window; without a window, to the end of the trajectory."""

    operand: Formula
    window: Window | None = None

    @property
    def children(self) -> tuple[Formula, ...]:
        """The operand."""
        return (self.operand,)

    def horizon(self, step: float = 0.0) -> float:
        """See Formula.horizon."""
        return _end(self.window) + self.operand.horizon(step)

    def __str__(self) -> str:
        return f"G{self.window or ''} {_prefixed(self.operand)}"


@dataclass(frozen=True, slots=True)
class Eventually(Formula):
    """The operand holds somewhere in the window; without a window, before the end of the trajectory."""

    operand: Formula
    window: Window | None = None

    @property
    def children(self) -> tuple[Formula, ...]:
        """The operand."""
        return (self.operand,)

    def horizon(self, step: float = 0.0) -> float:
        """See Formula.horizon."""
        return _end(self.window) + self.operand.horizon(step)

    def __str__(self) -> str:
        return f"F{self.window or ''} {_prefixed(self.operand)}"


@dataclass(frozen=True, slots=True)
class Until(Formula):
    """The right operand holds somewhere in the window, and the left one from now to then, both included."""

    left: Formula
    right: Formula
    window: Window | None = None
    binding: ClassVar[int] = UNTIL

    @property
    def children(self) -> tuple[Formula, ...]:
        """Left and right operand."""
        return (self.left, self.right)

    def horizon(self, step: float = 0.0) -> float:
        """See Formula.horizon."""
        return _end(self.window) + max(self.left.horizon(step), self.right.horizon(step))

    def __str__(self) -> str:
        return f"{_prefixed(self.left)} U{self.window or ''} {_prefixed(self.right)}"


@dataclass(frozen=True, slots=True)
class Next(Formula):
    """The operand holds at the next sample."""

    operand: Formula

    @property
    def children(self) -> tuple[Formula, ...]:
        """The operand."""
        return (self.operand,)

    def horizon(self, step: float = 0.0) -> float:
        """See Formula.horizon."""
        return step + self.operand.horizon(step)

    def __str__(self) -> str:
        return f"X {_prefixed(self.operand)}"


def is_flag(predicate: Predicate) -> bool:
    """Whether a predicate reads a Boolean signal: ``b`` alone in a formula means ``b >= 0.5``."""
    return predicate.operator == ">=" and isinstance(predicate.left, Name) and predicate.right == Number(0.5)


def _end(window: Window | None) -> float:
    return window.end if window else 0.0


def _prefixed(operand: Formula) -> str:
    # Predicates need no parentheses here, but readers do.
    return embraced(operand, PREFIX) if not isinstance(operand, Predicate) else f"({operand})"
