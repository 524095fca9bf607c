"""What equations and statements compute and need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..flat.ir import (
    Assert,
    Branch,
    Condition,
    DelayLine,
    Der,
    Edge,
    Equation,
    Flat,
    Outputs,
    Reinit,
    Scalar,
    Section,
    Set,
    Statement,
    Tick,
    Var,
    children,
)
from ..read.syntax import Place


@dataclass(frozen=True, slots=True)
class Solved:
    """`target = value`; the target is a variable, `der(x)` or `when(k)`."""

    target: str
    value: Scalar
    place: Place
    discrete: bool = False


Computed = Solved | Condition | Outputs | DelayLine | Section | Reinit | Assert


def bare_name(node: Scalar) -> str:
    """Return the name of an expression that is only a variable or derivative, else an empty string."""
    match node:
        case Var(name, _):
            return name
        case Der(name):
            return f"der({name})"
    return ""


def values(item: Flat | Computed | Statement) -> Iterator[Scalar]:
    """Yield all expressions in an equation or statement."""
    match item:
        case Equation():
            yield item.left
            yield item.right
        case Solved() | Condition() | Set():
            yield item.value
        case Outputs():
            for tensor in item.args:
                yield from tensor.items
        case DelayLine():
            yield item.position
        case Reinit():
            yield item.condition
            yield item.value
        case Assert():
            yield item.condition
        case Section():
            for statement in item.statements:
                yield from values(statement)
        case Branch():
            for condition, body in item.branches:
                yield condition
                for statement in body:
                    yield from values(statement)
            for statement in item.otherwise:
                yield from values(statement)


def targets(item: Flat | Computed | Statement) -> tuple[str, ...]:
    """Return the names that an item computes, each once."""
    match item:
        case Solved():
            return (item.target,)
        case Set():
            return (item.name,)
        case DelayLine():
            return (item.out.name,)
        case Condition():
            return (f"when({item.index})",)
        case Outputs():
            return tuple(name for target in item.targets if target for name in target)
        case Section():
            return tuple(dict.fromkeys(name for s in item.statements for name in targets(s)))
        case Branch():
            bodies = [*(body for _, body in item.branches), item.otherwise]
            return tuple(dict.fromkeys(name for body in bodies for s in body for name in targets(s)))
    return ()


def when_targets(item: Statement) -> tuple[str, ...]:
    """Return the variables that a statement sets in a when clause."""
    if isinstance(item, Branch) and all(only_at_events(condition) for condition, _ in item.branches):
        return tuple(name for name in targets(item) if not name.startswith("when("))
    return ()


def only_at_events(condition: Scalar) -> bool:
    """Whether a condition can only hold at an event."""
    return isinstance(condition, (Edge, Tick)) or (
        any(isinstance(part, (Edge, Tick)) for part in children(condition))
    )
