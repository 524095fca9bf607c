"""Algorithm sections of models -> statements with loops unrolled."""

from __future__ import annotations

from dataclasses import replace

from ..read.syntax import Assign, Body, ExportError, For, If, Item, Place, Ref, Run, Several, When
from .evaluate import Evaluator
from .ir import (
    Branch,
    DelayLine,
    Equation,
    Flat,
    FlatModel,
    Outputs,
    Scalar,
    Section,
    Set,
    Statement,
    Tensor,
    Var,
    names_in,
)
from .parts import (
    TRUE,
    assertion,
    loop_values,
    name_of,
    outputs,
    refuse_reinit,
    refuse_when,
    reinit,
    with_index,
)
from .tensors import fitted
from .whens import when_condition


def section(body: Body, place: Place, here: Evaluator, model: FlatModel) -> None:
    """Add an algorithm section to the model."""
    flat: Flat = Section(tuple(statements(body, here, model, TRUE)), place)
    model.equations.append(flat)


def statements(body: Body, here: Evaluator, model: FlatModel, guard: Scalar) -> list[Statement]:
    """Return statements with loops unrolled."""
    made: list[Statement] = []

    def keep(part: Outputs | Equation | DelayLine) -> None:
        if not isinstance(part, Outputs):
            raise ExportError(part.place, "'delay' in an algorithm is not supported; use an equation")
        made.append(part)

    local = here.at(here.scope, events=here.events, sink=keep)
    for item in body:
        _statement(item, local, model, made, guard)
    return made


def _statement(item: Item, here: Evaluator, model: FlatModel, made: list[Statement], guard: Scalar) -> None:
    match item:
        case Assign(left, right, place):
            target = _assignable(left, here)
            value = fitted(here.value(right), target.dims, target.type, place)
            made.extend(_sets(target, value, place, model))
        case Several():
            made.append(outputs(item, here))
        case For(index, over, body, place):
            for value_ in loop_values(over, here, place):
                made.extend(statements(body, with_index(here, index, value_), model, guard))
        case If(branches, otherwise, place):
            cases = []
            refuse_when(otherwise)
            for text, body in branches:
                refuse_when(body)
                condition = here.scalar(text)
                cases.append((condition, tuple(statements(body, here, model, guard))))
            made.append(Branch(tuple(cases), tuple(statements(otherwise, here, model, guard)), place))
        case When(branches, place):
            conditions = [when_condition(text, here, model, made.append) for text, _ in branches]
            cases = []
            with here.without_events():
                for edge, (_, body) in zip(conditions, branches, strict=True):
                    refuse_reinit(edge, body)
                    cases.append((edge, tuple(statements(body, here, model, guard))))
            made.append(Branch(tuple(cases), (), place))
        case Run(call, place) if call.name == "reinit":
            made.extend(reinit(call, here, TRUE))
        case Run(call, place) if call.name == "assert":
            made.append(assertion(call, here, TRUE))
        case Run(call, place):
            raise ExportError(place, f"a call of '{call.name}' as a statement is not supported")
        case _:
            raise ExportError(item.place, "'while', 'break' and 'return' are only supported in functions")


def _assignable(ref: Ref, here: Evaluator) -> Tensor:
    target = here.value(ref)
    for item in target.items:
        if not isinstance(item, Var):
            raise ExportError(
                ref.place, f"'{ref}' cannot be assigned (its subscripts must be known before simulation)"
            )
    return target


def _sets(target: Tensor, value: Tensor, place: Place, model: FlatModel) -> list[Statement]:
    """Assign element by element; use copies if an element is read after it has been set."""
    names = [name_of(item, place) for item in target.items]
    values = list(value.items)
    made: list[Statement] = []
    if len(names) > 1 and any(set(names) & names_in(item) for item in values):
        start = sum(name.startswith("$copy") for name in model.variables)
        for k, (name, item) in enumerate(zip(names, values, strict=True)):
            copy = replace(model.variables[name], name=f"$copy{start + k}", causality="local", public=False)
            model.variables[copy.name] = copy
            made.append(Set(copy.name, item, place))
            values[k] = Var(copy.name, copy.type)
    return made + [Set(name, item, place) for name, item in zip(names, values, strict=True)]
