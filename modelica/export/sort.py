"""Puts the equations in an order in which they can be computed one after the other."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

from . import fold
from .ir import (
    Assert,
    Branch,
    Condition,
    Der,
    Edge,
    Equation,
    Flat,
    FlatModel,
    Floor,
    Op,
    Outputs,
    Reinit,
    Relation,
    Scalar,
    Section,
    Set,
    Statement,
    Tick,
    Time,
    Var,
    children,
    names_in,
    walk,
)
from .syntax import ExportError, Place


@dataclass(frozen=True, slots=True)
class Solved:
    """`target = value`; the target is a variable, `der(x)` or `when(k)`."""

    target: str
    value: Scalar
    place: Place
    discrete: bool = False


Computed = Solved | Condition | Outputs | Section | Reinit | Assert


@dataclass(frozen=True, slots=True)
class Block:
    """One step of the computation.

    Attributes:
        defines: what it computes.
        uses: what needs to be known before.
        discrete: it can only change at events.
    """

    item: Computed
    defines: tuple[str, ...]
    uses: frozenset[str]
    discrete: bool


def states_of(model: FlatModel) -> list[str]:
    """Variables whose derivative appears, in the order of declaration."""
    found = set()
    for item in model.equations:
        for value in _values(item):
            found |= {part.name for part in walk(value) if isinstance(part, Der)}
    for name in found:
        variable = model.variables[name]
        if variable.causality == "input" or variable.variability != "continuous":
            raise ExportError(variable.place, f"'der({name})': '{name}' is not a continuous variable")
    return [name for name in model.variables if name in found]


def sort(model: FlatModel, states: list[str]) -> list[Block]:
    """Match equations with unknowns and order them.

    Raises:
        ExportError: too many or too few equations, an equation that cannot be solved, an algebraic loop.
    """
    unknown = _unknowns(model, states)
    items = _solve(model.equations, unknown, model)
    return _ordered(items, model, set(states))


def sort_initial(model: FlatModel, states: list[str]) -> list[Block]:
    """The order of the initial system: states with an initial equation are unknown as well."""
    unknown = _unknowns(model, states)
    given = {e.left.name: e for e in model.initial_equations if isinstance(e.left, Var)}
    items: list[Computed] = [
        Solved(name, equation.right, equation.place)
        for name, equation in given.items()
        if name in set(states)
    ]
    rest = _solve(model.equations, unknown, model)
    starts = {name: equation for name, equation in given.items() if name not in set(states)}
    for item in rest:
        if isinstance(item, Solved) and item.target in starts and item.discrete:
            equation = starts.pop(item.target)
            items.append(Solved(item.target, equation.right, equation.place, discrete=True))
        elif isinstance(item, (Reinit, Assert)):
            continue
        else:
            items.append(item)
    for name, equation in starts.items():
        raise ExportError(
            equation.place, f"'{name}' has an equation already; an initial equation is one too many"
        )
    return _ordered(items, model, set(states))


def _unknowns(model: FlatModel, states: list[str]) -> set[str]:
    result = {f"der({name})" for name in states}
    for name, variable in model.variables.items():
        if variable.variability != "parameter" and variable.causality != "input" and name not in set(states):
            result.add(name)
    return result


# --------------------------------------------------------------------- matching


def _solve(equations: list[Flat], unknown: set[str], model: FlatModel) -> list[Computed]:
    fixed: list[Computed] = []
    open_equations: list[Equation] = []
    taken: dict[str, Place] = {}
    for item in equations:
        if isinstance(item, Equation):
            open_equations.append(item)
            continue
        fixed.append(item)
        for name in _targets(item):
            if name in taken:
                raise ExportError(item.place, f"'{name}' is computed here and at {taken[name]}")
            if name not in unknown and not name.startswith("when("):
                raise ExportError(
                    item.place, f"'{name}' cannot be computed here: it is an input, parameter or state"
                )
            taken[name] = item.place
    free = unknown - set(taken)
    matched = _match(open_equations, free, model)
    return fixed + matched


def _match(equations: list[Equation], free: set[str], model: FlatModel) -> list[Computed]:
    options = [_candidates(item, free) for item in equations]
    owner: dict[str, int] = {}

    def assign(index: int, seen: set[str]) -> bool:
        for name in options[index]:
            if name in seen:
                continue
            seen.add(name)
            if name not in owner or assign(owner[name], seen):
                owner[name] = index
                return True
        return False

    sys.setrecursionlimit(max(sys.getrecursionlimit(), 10 * len(equations) + 1000))
    for index, item in enumerate(equations):
        if not assign(index, set()):
            raise ExportError(item.place, _unmatched(item, free, owner, equations))
    missing = sorted(free - set(owner))
    if missing:
        place = _declared(missing[0], model)
        raise ExportError(
            place, f"there is no equation for {', '.join(missing[:5])}" + " ..." * (len(missing) > 5)
        )
    result: list[Computed] = []
    for name, index in sorted(owner.items(), key=lambda pair: pair[1]):
        item = equations[index]
        result.append(Solved(name, options[index][name], item.place, item.discrete))
    return result


def _unmatched(item: Equation, free: set[str], owner: dict[str, int], equations: list[Equation]) -> str:
    involved = sorted((names_in(item.left) | names_in(item.right)) & free)
    if not involved:
        return "this equation has no unknown variable"
    others = ", ".join(
        f"{name} (line {equations[owner[name]].place.line})" for name in involved if name in owner
    )
    return (
        f"there is one equation too many, or this one cannot be solved for one of {', '.join(involved)}"
        + (f"; taken: {others}" if others else "")
    )


def _declared(key: str, model: FlatModel) -> Place:
    return model.variables[
        key.removeprefix("der(").removesuffix(")") if key.startswith("der(") else key
    ].place


def _candidates(item: Equation, free: set[str]) -> dict[str, Scalar]:
    """What the equation can be solved for, best first."""
    found: dict[str, Scalar] = {}
    for one, other in ((item.left, item.right), (item.right, item.left)):
        name = _bare(one)
        fits = one.type == other.type or one.type == "Real"
        if name in free and fits and name not in names_in(other):
            found.setdefault(name, other)
    if item.discrete:
        return found
    for one, other in ((item.left, item.right), (item.right, item.left)):
        counts: dict[str, int] = {}
        for part in walk(one):
            name = _bare(part)
            if name in free:
                counts[name] = counts.get(name, 0) + 1
        for name, count in counts.items():
            if count == 1 and name not in names_in(other) and name not in found:
                value = _isolate(one, other, name, item.place)
                if value is not None:
                    found[name] = value
    return found


def _bare(node: Scalar) -> str:
    match node:
        case Var(name, _):
            return name
        case Der(name):
            return f"der({name})"
    return ""


def _isolate(node: Scalar, other: Scalar, name: str, place: Place) -> Scalar | None:
    """Move everything but the unknown to the other side."""
    while _bare(node) != name:
        if not isinstance(node, Op) or node.type != "Real":
            return None
        match node.name, node.args:
            case "neg", (a,):
                node, other = a, fold.arithmetic("neg", (other,), place)
            case "real", _:
                return None
            case ("+" | "-" | "*" | "/") as operator, (a, b):
                inside = name in names_in(a)
                node, known = (a, b) if inside else (b, a)
                other = fold.arithmetic(*_inverse(operator, other, known, inside=inside), place)
            case _:
                return None
    return other


def _inverse(operator: str, other: Scalar, known: Scalar, *, inside: bool) -> tuple[str, tuple[Scalar, ...]]:
    match operator, inside:
        case "+", _:
            return "-", (other, known)
        case "-", True:
            return "+", (other, known)
        case "-", False:
            return "-", (known, other)
        case "*", _:
            return "/", (other, known)
        case "/", True:
            return "*", (other, known)
    return "/", (known, other)


# --------------------------------------------------------------------- contents


def _values(item: Flat | Computed | Statement) -> Iterator[Scalar]:
    """All expressions in an equation or statement."""
    match item:
        case Equation():
            yield item.left
            yield item.right
        case Solved() | Condition() | Set():
            yield item.value
        case Outputs():
            for tensor in item.args:
                yield from tensor.items
        case Reinit():
            yield item.condition
            yield item.value
        case Assert():
            yield item.condition
        case Section():
            for statement in item.statements:
                yield from _values(statement)
        case Branch():
            for condition, body in item.branches:
                yield condition
                for statement in body:
                    yield from _values(statement)
            for statement in item.otherwise:
                yield from _values(statement)


values = _values


def _targets(item: Flat | Computed | Statement) -> tuple[str, ...]:
    """What an item computes, each once."""
    match item:
        case Solved():
            return (item.target,)
        case Set():
            return (item.name,)
        case Condition():
            return (f"when({item.index})",)
        case Outputs():
            return tuple(name for target in item.targets if target for name in target)
        case Section():
            return tuple(dict.fromkeys(name for s in item.statements for name in _targets(s)))
        case Branch():
            bodies = [*(body for _, body in item.branches), item.otherwise]
            return tuple(dict.fromkeys(name for body in bodies for s in body for name in _targets(s)))
    return ()


def when_targets(item: Statement) -> tuple[str, ...]:
    """Variables that a statement sets inside of a when clause."""
    if isinstance(item, Branch) and all(_only_at_events(condition) for condition, _ in item.branches):
        return tuple(name for name in _targets(item) if not name.startswith("when("))
    return ()


# --------------------------------------------------------------------- order


def _ordered(items: list[Computed], model: FlatModel, states: set[str]) -> list[Block]:
    defines = [_targets(item) for item in items]
    producer = {name: k for k, names in enumerate(defines) for name in names}
    uses = [
        frozenset(n for value in _values(item) for n in names_in(value)) - set(defines[k])
        for k, item in enumerate(items)
    ]
    for k, item in enumerate(items):
        if isinstance(item, Solved) and item.target in {n for v in _values(item) for n in names_in(v)}:
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
    """Order by dependence; equations of a loop are named in the error."""
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
    return not any(_varies(value, continuous) for value in _values(item))


def _discrete_statement(item: Statement, continuous: set[str]) -> bool:
    match item:
        case Condition() | Reinit():
            return True
        case Branch() if (
            all(_only_at_events(condition) for condition, _ in item.branches) and not item.otherwise
        ):
            return True
    return not any(_varies(value, continuous) for value in _values(item))


def _only_at_events(condition: Scalar) -> bool:
    return isinstance(condition, (Edge, Tick)) or (
        any(isinstance(part, (Edge, Tick)) for part in children(condition))
    )


def _varies(node: Scalar, continuous: set[str]) -> bool:
    """Whether an expression can change between events; relations are frozen there."""
    match node:
        case Time():
            return True
        case Var() | Der():
            return _bare(node) in continuous or isinstance(node, Der)
        case Relation() | Floor():
            return False
    return any(_varies(child, continuous) for child in children(node))
