"""Parameters that depend on others, and start values that depend on parameters."""

from __future__ import annotations

from ..flat.ir import DelayLine, FlatModel, Lit, Pre, Scalar, Tick, Time, Variable, names_in, walk
from ..read.syntax import ExportError
from .contents import values


def sorted_parameters(model: FlatModel) -> list[Variable]:
    """Return the calculated parameters in an order in which they can be computed."""
    order: list[Variable] = []
    state: dict[str, int] = {}

    def visit(variable: Variable) -> None:
        if isinstance(variable.binding, Lit) or state.get(variable.name) == 2:
            return
        if state.get(variable.name) == 1:
            raise ExportError(variable.place, f"the value of '{variable.name}' depends on itself")
        state[variable.name] = 1
        for name in sorted(_known_names(variable.binding, variable, model)):
            visit(model.variables[name])
        state[variable.name] = 2
        order.append(variable)

    for item in model.variables.values():
        if item.variability == "parameter":
            visit(item)
    return order


def calculated_starts(model: FlatModel) -> list[Variable]:
    """Return the variables whose start value is an expression of parameters."""
    found = []
    for variable in model.variables.values():
        if (
            variable.variability != "parameter"
            and variable.start is not None
            and not isinstance(variable.start, Lit)
        ):
            if variable.causality == "input":
                raise ExportError(
                    variable.place, f"the start value of the input '{variable.name}' must be a literal"
                )
            _known_names(variable.start, variable, model)
            found.append(variable)
    return found


def _known_names(value: Scalar | None, variable: Variable, model: FlatModel) -> set[str]:
    names: set[str] = names_in(value) if value is not None else set()
    timed = value is not None and any(isinstance(part, (Time, Pre)) for part in walk(value))
    for name in names:
        if name not in model.variables or model.variables[name].variability != "parameter":
            raise ExportError(
                variable.place, f"'{variable.name}' may only depend on parameters, not on '{name}'"
            )
    if timed:
        raise ExportError(variable.place, f"'{variable.name}' may not depend on time")
    return names


def fixed_names(model: FlatModel) -> set[str]:
    """Return the parameters used only at the start: in start values, initial equations and sample times."""
    seeds: set[str] = set()
    for variable in calculated_starts(model):
        assert variable.start is not None
        seeds |= names_in(variable.start)
    for equation in model.initial_equations:
        seeds |= names_in(equation.right)
    for item in model.equations:
        if isinstance(item, DelayLine):
            for value in (item.span, *(seed for _, seed in item.seeds)):
                seeds |= names_in(value)
        for value in values(item):
            for part in walk(value):
                if isinstance(part, Tick):
                    seeds |= names_in(part.start) | names_in(part.interval)
    found: set[str] = set()
    while seeds:
        name = seeds.pop()
        if name in found or name not in model.variables:
            continue
        found.add(name)
        binding = model.variables[name].binding
        if binding is not None:
            seeds |= names_in(binding)
    return found
