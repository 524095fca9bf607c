"""When clauses -> scalar equations that act when a condition becomes true."""

from __future__ import annotations

from collections.abc import Callable

from ..read.syntax import (
    ArrayOf,
    Body,
    Call,
    Equal,
    ExportError,
    Expr,
    For,
    If,
    Operation,
    Run,
    Several,
    When,
)
from . import fold
from .evaluate import Evaluator
from .ir import Condition, Edge, Equation, FlatModel, Initial, Lit, Pre, Scalar, Tick, Var
from .parts import TRUE, assertion, loop_values, name_of, refuse_reinit, reinit, set_once, with_index
from .tensors import cast, fitted


def when_condition(text: Expr, here: Evaluator, model: FlatModel, add: Callable[[Condition], None]) -> Scalar:
    """Return an expression that is true at the instant when the condition becomes true."""
    if isinstance(text, ArrayOf):
        result = when_condition(text.elements[0], here, model, add)
        for element in text.elements[1:]:
            other = when_condition(element, here, model, add)
            result = fold.logic("or", (result, other), text.place)
        return result
    if isinstance(text, Call) and text.name == "sample":
        return _tick(text, here)
    if isinstance(text, Operation) and text.operator == "and":
        first, second = text.operands
        if isinstance(first, Call) and first.name == "sample":
            with here.without_events():
                return fold.logic("and", (_tick(first, here), here.scalar(second)), text.place)
    value = here.scalar(text)
    if value.type != "Boolean":
        raise ExportError(text.place, "the condition of 'when' must be Boolean")
    if isinstance(value, Initial):
        return value
    model.conditions += 1
    add(Condition(model.conditions, value, text.place))
    return Edge(model.conditions)


def _tick(call: Call, here: Evaluator) -> Tick:
    if len(call.arguments) != 2 or call.named:
        raise ExportError(call.place, "'sample' expects two arguments: sample(start, interval)")
    start, interval = (cast(here.scalar(text), "Real", call.place) for text in call.arguments)
    for value in (start, interval):
        if not here.parametric(value):
            raise ExportError(call.place, "the arguments of 'sample' must be parameters or literals")
    return Tick(start, interval)


def when_equation(item: When, here: Evaluator, model: FlatModel) -> None:
    """Add one scalar equation per variable that the when clause sets."""
    cases: list[tuple[Scalar, dict[str, Equation]]] = []
    earlier: Scalar = Lit(value=False, type="Boolean")
    for text, body in item.branches:
        edge = when_condition(text, here, model, model.equations.append)
        refuse_reinit(edge, body)
        guard = fold.logic("and", (edge, fold.logic("not", (earlier,), item.place)), item.place)
        with here.without_events():
            cases.append((edge, _when_body(body, guard, here, model)))
        earlier = fold.logic("or", (earlier, edge), item.place)
    targets = dict.fromkeys(key for _, found in cases for key in found)
    for target in targets:
        if any(found and target not in found for _, found in cases):
            raise ExportError(item.place, f"every branch of this when clause must set '{target}'")
        variable = model.variables[target]
        value: Scalar = Pre(target, variable.type)
        for edge, found in reversed(cases):
            if target in found:
                value = fold.choose(edge, found[target].right, value, item.place)
        model.equations.append(Equation(Var(target, variable.type), value, item.place, discrete=True))


def _when_body(body: Body, guard: Scalar, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    """Return the equations of a when clause by variable; add reinit and assert to the model, with a guard."""
    found: dict[str, Equation] = {}
    for item in body:
        match item:
            case Equal(left, right, place):
                target, value = here.value(left), here.value(right)
                value = fitted(value, target.dims, target.type, place)
                for one, other in zip(target.items, value.items, strict=True):
                    set_once(found, {name_of(one, place): Equation(one, other, place, discrete=True)})
            case Several(place=place):
                raise ExportError(
                    place,
                    "a function with several outputs in a when equation is not supported; "
                    "use an algorithm section",
                )
            case For(index, over, inner, place):
                for value_ in loop_values(over, here, place):
                    set_once(found, _when_body(inner, guard, with_index(here, index, value_), model))
            case If():
                set_once(found, _when_if(item, guard, here, model))
            case Run(call, place) if call.name == "reinit":
                model.equations.extend(reinit(call, here, guard))
            case Run(call, place) if call.name == "assert":
                model.equations.append(assertion(call, here, guard))
            case Run(call, place):
                raise ExportError(place, f"'{call.name}' is not allowed in a when clause")
            case _:
                raise ExportError(item.place, "this is not allowed in a when clause")
    return found


def _when_if(item: If, guard: Scalar, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    cases: list[tuple[Scalar, dict[str, Equation]]] = []
    remaining = guard
    for text, body in item.branches:
        condition = here.scalar(text)
        inner = fold.logic("and", (remaining, condition), item.place)
        cases.append((condition, _when_body(body, inner, here, model)))
        remaining = fold.logic("and", (remaining, fold.logic("not", (condition,), item.place)), item.place)
    last = _when_body(item.otherwise, remaining, here, model)
    result = {}
    for target in dict.fromkeys(key for _, found in [*cases, (TRUE, last)] for key in found):
        if target not in last or any(target not in found for _, found in cases):
            raise ExportError(item.place, f"every branch of 'if' in a when clause must set '{target}'")
        value = last[target].right
        for condition, found in reversed(cases):
            value = fold.choose(condition, found[target].right, value, item.place)
        result[target] = Equation(last[target].left, value, item.place, discrete=True)
    return result
