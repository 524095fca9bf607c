"""Assigns to every equation the unknown for which it is solved."""

from __future__ import annotations

import sys

from ..flat import fold
from ..flat.ir import Equation, Flat, FlatModel, Op, Scalar, names_in, walk
from ..read.syntax import ExportError, Place
from .contents import Computed, Solved, bare_name, targets


def solve(equations: list[Flat], unknown: set[str], model: FlatModel) -> list[Computed]:
    """Match equations and unknowns.

    Raises:
        ExportError: if there are too many or too few equations, or one cannot be solved for any of its
            unknowns.
    """
    fixed: list[Computed] = []
    open_equations: list[Equation] = []
    taken: dict[str, Place] = {}
    for item in equations:
        if isinstance(item, Equation):
            open_equations.append(item)
            continue
        fixed.append(item)
        for name in targets(item):
            if name in taken:
                raise ExportError(item.place, f"'{name}' is already computed at {taken[name]}")
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
    """Return the unknowns for which the equation can be solved, best first, with their expressions."""
    found: dict[str, Scalar] = {}
    for one, other in ((item.left, item.right), (item.right, item.left)):
        name = bare_name(one)
        fits = one.type == other.type or one.type == "Real"
        if name in free and fits and name not in names_in(other):
            found.setdefault(name, other)
    if item.discrete:
        return found
    for one, other in ((item.left, item.right), (item.right, item.left)):
        counts: dict[str, int] = {}
        for part in walk(one):
            name = bare_name(part)
            if name in free and part.type == "Real":  # an Integer would lose its fraction
                counts[name] = counts.get(name, 0) + 1
        for name, count in counts.items():
            if count == 1 and name not in names_in(other) and name not in found:
                value = _isolate(one, other, name, item.place)
                if value is not None:
                    found[name] = value
    return found


def _isolate(node: Scalar, other: Scalar, name: str, place: Place) -> Scalar | None:
    """Move everything except the unknown to the other side; return None if that is impossible."""
    while bare_name(node) != name:
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
