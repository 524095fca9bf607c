"""Sorts the equations into an order in which they can be computed one after the other."""

from __future__ import annotations

from dataclasses import dataclass

from ..flat.ir import (
    Assert,
    Branch,
    Condition,
    DelayLine,
    Der,
    Equation,
    FlatModel,
    Floor,
    Outputs,
    Reinit,
    Relation,
    Scalar,
    Section,
    Statement,
    Time,
    Var,
    children,
    names_in,
    walk,
)
from ..read.syntax import ExportError
from .contents import Computed, Solved, bare_name, only_at_events, targets, values
from .solve import solve


@dataclass(frozen=True, slots=True)
class Block:
    """One step of the computation.

    Attributes:
        defines: names that it computes.
        uses: names that must be computed before.
        discrete: whether it can only change at events.
    """

    item: Computed
    defines: tuple[str, ...]
    uses: frozenset[str]
    discrete: bool


def states_of(model: FlatModel) -> list[str]:
    """Return the variables whose derivative occurs, in the order of declaration."""
    found = set()
    for item in model.equations:
        for value in values(item):
            found |= {part.name for part in walk(value) if isinstance(part, Der)}
    for name in found:
        variable = model.variables[name]
        if variable.causality == "input" or variable.variability != "continuous":
            raise ExportError(variable.place, f"'der({name})': '{name}' is not a continuous variable")
    return [name for name in model.variables if name in found]


def sort(model: FlatModel, states: list[str]) -> list[Block]:
    """Match equations with unknowns and order them.

    Raises:
        ExportError: for too many or too few equations, an equation that cannot be solved, an algebraic loop.
    """
    unknown = _unknowns(model, states)
    items = solve(model.equations, unknown, model)
    return _ordered(items, model, set(states))


def sort_initial(model: FlatModel, states: list[str]) -> list[Block]:
    """Return the order of the initial system, in which states with an initial equation are unknowns too."""
    unknown = _unknowns(model, states)
    given: dict[str, Equation] = {}
    for one in model.initial_equations:
        if isinstance(one.left, Var) and given.setdefault(one.left.name, one) is not one:
            place = given[one.left.name].place
            raise ExportError(one.place, f"'{one.left.name}' already has an initial equation at {place}")
    items: list[Computed] = [
        Solved(name, equation.right, equation.place)
        for name, equation in given.items()
        if name in set(states)
    ]
    rest = solve(model.equations, unknown, model)
    starts = {name: equation for name, equation in given.items() if name not in set(states)}
    for item in rest:
        if isinstance(item, Solved) and item.target in starts and item.discrete:
            equation = starts.pop(item.target)
            items.append(Solved(item.target, equation.right, equation.place, discrete=True))
        elif isinstance(item, DelayLine):
            items.append(Solved(item.out.name, item.first, item.place))
        elif isinstance(item, (Reinit, Assert)):
            continue
        else:
            items.append(item)
    for name, equation in starts.items():
        raise ExportError(equation.place, f"'{name}' already has an equation; remove its initial equation")
    return _ordered(items, model, set(states))


def _unknowns(model: FlatModel, states: list[str]) -> set[str]:
    result = {f"der({name})" for name in states}
    for name, variable in model.variables.items():
        if variable.variability != "parameter" and variable.causality != "input" and name not in set(states):
            result.add(name)
    return result


def _ordered(items: list[Computed], model: FlatModel, states: set[str]) -> list[Block]:
    defines = [targets(item) for item in items]
    producer = {name: k for k, names in enumerate(defines) for name in names}
    uses = [
        frozenset(n for value in values(item) for n in names_in(value)) - set(defines[k])
        for k, item in enumerate(items)
    ]
    for item in items:
        if isinstance(item, Solved) and item.target in {n for v in values(item) for n in names_in(v)}:
            raise ExportError(
                item.place, f"'{item.target}' depends on itself; algebraic loops are not supported"
            )
    needs = [[producer[name] for name in used if name in producer] for used in map(sorted, uses)]
    order = _topological(needs, items, defines)
    continuous = set(states) | {
        n for n, v in model.variables.items() if v.causality == "input" and v.type == "Real"
    }
    blocks = []
    for k in order:
        discrete = _is_discrete(items[k], continuous)
        if not discrete:
            continuous |= set(defines[k])
        blocks.append(Block(items[k], defines[k], uses[k], discrete))
    return blocks


def _topological(needs: list[list[int]], items: list[Computed], defines: list[tuple[str, ...]]) -> list[int]:
    """Return an order in which each item follows those that it needs; a loop is an error with its items."""
    order: list[int] = []
    state = [0] * len(items)
    for root in range(len(items)):
        stack = [(root, iter(needs[root]))] if not state[root] else []
        state[root] = state[root] or 1
        while stack:
            node, rest = stack[-1]
            following = next(rest, None)
            if following is None:
                stack.pop()
                state[node] = 2
                order.append(node)
            elif state[following] == 1:
                loop = [k for k, _ in stack]
                raise ExportError(
                    items[node].place, _loop_text(loop[loop.index(following) :], items, defines)
                )
            elif state[following] == 0:
                state[following] = 1
                stack.append((following, iter(needs[following])))
    return order


def _loop_text(loop: list[int], items: list[Computed], defines: list[tuple[str, ...]]) -> str:
    steps = ", ".join(f"{'/'.join(defines[k][:3])} (line {items[k].place.line})" for k in loop)
    return f"algebraic loop, which is not supported: {steps}"


def _is_discrete(item: Computed, continuous: set[str]) -> bool:
    match item:
        case Condition() | Reinit():
            return True
        case Solved(discrete=True) | Outputs(discrete=True):
            return True
        case Assert():
            return False
        case Section():
            return all(_discrete_statement(statement, continuous) for statement in item.statements)
    return not any(_varies(value, continuous) for value in values(item))


def _discrete_statement(item: Statement, continuous: set[str]) -> bool:
    match item:
        case Condition() | Reinit():
            return True
        case Branch() if (
            all(only_at_events(condition) for condition, _ in item.branches) and not item.otherwise
        ):
            return True
    return not any(_varies(value, continuous) for value in values(item))


def _varies(node: Scalar, continuous: set[str]) -> bool:
    """Whether an expression can change between events; relations are frozen there."""
    match node:
        case Time():
            return True
        case Var() | Der():
            return bare_name(node) in continuous or isinstance(node, Der)
        case Relation() | Floor():
            return False
    return any(_varies(child, continuous) for child in children(node))
