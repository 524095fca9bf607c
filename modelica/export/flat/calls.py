"""Calls of Modelica functions from models."""

from __future__ import annotations

from math import prod

from ..read.syntax import Call, Class, Colon, Component, ExportError, Place
from .instance import Evaluation, Scope
from .ir import Outputs, Tensor, Var, Variable
from .tensors import fitted, type_of


def function_outputs(function: Class, call: Call) -> list[Component]:
    """Return the outputs of a function.

    Raises:
        ExportError: if it has none.
    """
    outputs = [item for item in function.components if item.causality == "output"]
    if not outputs:
        raise ExportError(call.place, f"the function '{call.name}' has no output")
    return outputs


def arguments(here: Evaluation, function: Class, call: Call) -> tuple[Tensor, ...]:
    """Return the values for all inputs of a function, in their order."""
    inputs = [item for item in function.components if item.causality == "input"]
    given: dict[str, Tensor] = {}
    if len(call.arguments) > len(inputs):
        raise ExportError(
            call.place, f"'{call.name}' expects {len(inputs)} arguments, got {len(call.arguments)}"
        )
    for item, text in zip(inputs, call.arguments, strict=False):
        given[item.name] = here.value(text)
    for name, text in call.named:
        if name in given or name not in {item.name for item in inputs}:
            raise ExportError(call.place, f"'{call.name}' has no free argument '{name}'")
        given[name] = here.value(text)
    result = []
    for item in inputs:
        if item.name not in given:
            if item.modifier.value is None:
                raise ExportError(call.place, f"the argument '{item.name}' of '{call.name}' is missing")
            given[item.name] = here.at(Scope(None, function)).value(item.modifier.value)
        result.append(fit_argument(here, item, given, function, call))
    return tuple(result)


def fit_argument(
    here: Evaluation, item: Component, given: dict[str, Tensor], function: Class, call: Call
) -> Tensor:
    """Check one argument against the declaration; return it with the declared type."""
    value, kind = given[item.name], type_of(item)
    wanted = here.at(Scope(None, function, given))
    if len(value.dims) != len(item.dimensions):
        raise ExportError(
            call.place,
            f"the argument '{item.name}' of '{call.name}' must have {len(item.dimensions)} dimensions, "
            f"not {len(value.dims)}",
        )
    for text, size in zip(item.dimensions, value.dims, strict=True):
        if not isinstance(text, Colon) and (n := wanted.static_integer(text, call.place)) != size:
            raise ExportError(call.place, f"'{item.name}' of '{call.name}' must have size {n}, not {size}")
    return fitted(value, value.dims, kind, call.place)


def lifted(here: Evaluation, function: Class, args: tuple[Tensor, ...], place: Place) -> list[Tensor]:
    """Call a function with array results or several outputs; auxiliary variables receive the results."""
    if here.sink is None:
        raise ExportError(
            place, f"'{function.name}' has an array or several outputs, which is not supported here"
        )
    inputs = [item for item in function.components if item.causality == "input"]
    given = {item.name: value for item, value in zip(inputs, args, strict=True)}
    scope = here.at(Scope(None, function, given))
    results: list[Tensor] = []
    for item in function.components:
        if item.causality != "output":
            continue
        dims = tuple(scope.static_integer(text, item.place) for text in item.dimensions)
        leaf_name = f"$call{sum(name.startswith('$call') for name in here.model.variables) + 1}"
        kind = type_of(item)
        names = [f"{leaf_name}.{k}" for k in range(prod(dims))]
        for name in names:
            here.model.variables[name] = Variable(
                name=name,
                type=kind,
                variability="continuous" if kind == "Real" else "discrete",
                causality="local",
                public=False,
                final=False,
                place=place,
            )
        results.append(Tensor(dims, tuple(Var(name, kind) for name in names), kind))
    targets = tuple(tuple(v.name for v in t.items if isinstance(v, Var)) for t in results)
    here.sink(Outputs(targets, function.full_name, args, place))
    return results
