"""Equations, if-equations and loops of one instance -> scalar equations."""

from __future__ import annotations

from ..read.syntax import Body, Call, Equal, ExportError, For, If, Item, Place, Run, Several, When
from . import fold
from .delays import spatial_distribution
from .evaluate import Evaluator
from .ir import DelayLine, Der, Equation, FlatModel, Lit, Outputs, Scalar, Tensor, Var, alike, is_delayed
from .parts import TRUE, assertion, loop_values, outputs, refuse_when, set_once, with_index
from .whens import when_equation


def equation(item: Item, here: Evaluator, model: FlatModel) -> None:
    """Add the scalar equations of one equation to the model."""
    match item:
        case Equal(left, right, place):
            _equal(here.value(left), here.value(right), place, model)
        case Several(right=Call(name="spatialDistribution")):
            model.equations.extend(spatial_distribution(here, item))
        case Several():
            model.equations.append(outputs(item, here))
        case For(index, over, body, place):
            for value in loop_values(over, here, place):
                inner = with_index(here, index, value)
                for part in body:
                    equation(part, inner, model)
        case If():
            _if_equation(item, here, model)
        case When():
            when_equation(item, here, model)
        case Run(call, place) if call.name == "assert":
            model.equations.append(assertion(call, here, TRUE))
        case Run(call, place):
            raise ExportError(place, f"'{call.name}' is not allowed here")
        case _:
            raise ExportError(item.place, "this is not an equation")


def _equal(left: Tensor, right: Tensor, place: Place, model: FlatModel) -> None:
    if left.dims != right.dims:
        raise ExportError(place, f"the two sides of '=' have sizes {list(left.dims)} and {list(right.dims)}")
    for a, b in zip(left.items, right.items, strict=True):
        if not alike(a.type, b.type):
            raise ExportError(place, f"'=' between {a.type} and {b.type}")
        for one, other in ((a, b), (b, a)):
            real = other.type == "Real" and not isinstance(other, (Var, Der))
            if isinstance(one, Var) and one.type == "Integer" and real:
                raise ExportError(
                    place, f"a Real cannot be assigned to the Integer '{one.name}'; use integer(...)"
                )
        model.equations.append(Equation(a, b, place))


def _if_equation(item: If, here: Evaluator, model: FlatModel) -> None:
    pending: list[tuple[Scalar, Body]] = []
    otherwise = item.otherwise
    for text, body in item.branches:
        condition = here.scalar(text)
        if isinstance(condition, Lit):
            if condition.value:
                otherwise = body
                break
            continue
        pending.append((condition, body))
    if not pending:
        for part in otherwise:
            equation(part, here, model)
        return
    cases = [(condition, _branch_equations(body, here, model)) for condition, body in pending]
    last = _branch_equations(otherwise, here, model)
    for target in dict.fromkeys(key for _, found in [*cases, (TRUE, last)] for key in found):
        if target not in last or any(target not in found for _, found in cases):
            raise ExportError(
                item.place, f"every branch of an if-equation needs an equation '{target} = ...'"
            )
        value = last[target].right
        for condition, found in reversed(cases):
            value = fold.choose(condition, found[target].right, value, item.place)
        model.equations.append(Equation(last[target].left, value, item.place))


def _branch_equations(body: Body, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    """Return the equations of one branch, by the variable or derivative on their left side."""
    refuse_when(body)
    before = len(model.equations)
    for part in body:
        equation(part, here, model)
    made = model.equations[before:]
    found: dict[str, Equation] = {}
    del model.equations[before:]
    for item in made:
        if isinstance(item, DelayLine) or (isinstance(item, Equation) and _of_a_delay(item)):
            model.equations.append(item)
        elif isinstance(item, Equation) and isinstance(item.left, (Var, Der)):
            key = item.left.name if isinstance(item.left, Var) else f"der({item.left.name})"
            set_once(found, {key: item})
        elif isinstance(item, Outputs) and all(t and t[0].startswith("$call") for t in item.targets):
            model.equations.append(item)
        else:
            raise ExportError(
                item.place, "an equation inside 'if' must have the form 'x = ...' or 'der(x) = ...'"
            )
    return found


def _of_a_delay(item: Equation) -> bool:
    return isinstance(item.left, Var) and is_delayed(item.left.name)
