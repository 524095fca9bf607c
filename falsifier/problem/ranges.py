"""Ranges and values of a spec, checked against the FMU's variables and completed from them."""

from collections.abc import Iterable, Mapping
from math import ceil, floor
from pathlib import Path

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace, ValueKind
from falsifier.errors import SpecError, did_you_mean, in_section
from falsifier.problem.sections import InputSection, ParameterSection
from falsifier.problem.shorthand import named_file

# Number of control points of an input of which nobody states it: both ends, the middle and two in between.
DEFAULT_POINTS = 5


def search_space(
    inputs: Mapping[str, InputSection],
    parameters: Mapping[str, ParameterSection],
    info: ModelInfo,
    stop_time: float,
) -> tuple[SearchSpace, dict[str, float]]:
    """Return what is searched, and the values of what is fixed.

    Args:
        inputs: the inputs' sections by name, as they hold after all overrides.
        parameters: the same of parameters and start values.
        info: the model's variables.
        stop_time: end of the simulation in s.

    Raises:
        SpecError: naming the key and the remedy.
    """
    searched: list[InputRange] = []
    ranges: list[ParameterRange] = []
    fixed: dict[str, float] = {}
    for name, section in inputs.items():
        with in_section(key=f"inputs.{name}"):
            variable = _input(name, info)
            if section.value is not None:
                fixed[name] = fixed_value(variable, section.value)
            else:
                searched.append(input_range(variable, section))
    for name, parameter in parameters.items():
        with in_section(key=f"parameters.{name}"):
            variable = _parameter(name, info)
            if parameter.range is not None:
                ranges.append(parameter_range(variable, parameter.range))
            elif parameter.value is not None and variable.kind != "string":
                fixed[name] = fixed_value(variable, parameter.value)
    return SearchSpace(tuple(searched), tuple(ranges), stop_time), fixed


def _input(name: str, info: ModelInfo) -> Variable:
    if name in info and info[name].alias_of:
        raise SpecError(f"the {info.noun} has one input with two names: use {info[name].alias_of!r} instead")
    _check_unconnected(name, info)
    return _variable(name, info.inputs, f"the {info.noun} has no such input")


def _parameter(name: str, info: ModelInfo) -> Variable:
    """Return a parameter or start value that can be set."""
    if name in info and info[name].causality == "input":
        raise SpecError(f"{name} is an input; write [inputs.{name}]")
    _check_unconnected(name, info)
    if name in info and not info[name].settable:
        v = info[name]
        reason = f"it is a {v.variability} {v.causality} of the {info.noun}"
        reason = f"it is another name of {v.alias_of!r}; use that one" if v.alias_of else reason
        raise SpecError(f"cannot be set: {reason}")
    settable = [v for v in info.variables if v.settable and v.causality != "input"]
    return _variable(name, settable, f"the {info.noun} has no such parameter or start value")


def input_range(variable: Variable, section: InputSection) -> InputRange:
    """Return the searched input for a section, completed from the FMU's min, max, unit and description.

    Raises:
        SpecError: if range or control points are unknown, or the range exceeds the FMU's min and max.
    """
    smallest, largest = section.range or variable.limits
    if smallest is None or largest is None:
        raise SpecError(
            "the FMU specifies no min and max for this input; add range = [low, high] or "
            f"--search {variable.name}=LOW:HIGH[:POINTS]",
            key="range",
        )
    low, high = _within(variable, (smallest, largest))
    if section.control_points is None:
        raise SpecError(
            "this key is missing; specify the number of evenly spaced control points", key="control_points"
        )
    discrete = variable.kind != "real"
    interpolation = section.interpolation or ("constant" if discrete else "pchip")
    if discrete and interpolation != "constant":
        raise SpecError(
            f'values of type {variable.kind} cannot be interpolated; use "constant"', key="interpolation"
        )
    free = section.free
    return InputRange(
        variable.name,
        low,
        high,
        control_points=section.control_points,
        interpolation=interpolation,
        hold=section.hold,
        free=Freedom(free.max_control_points, free.min_interval) if free else None,
        unit=variable.unit,
        description=variable.description,
        kind=_value_kind(variable),
        items=tuple(variable.literals.items()),
    )


def parameter_range(variable: Variable, limits: tuple[float, float]) -> ParameterRange:
    """Return the searched parameter, completed from the FMU's start value, unit and description.

    Raises:
        SpecError: if the range exceeds the FMU's min and max, or the range of the variable's type.
    """
    low, high = _within(variable, limits)
    return ParameterRange(
        variable.name,
        low,
        high,
        nominal=variable.start if isinstance(variable.start, int | float) else None,
        unit=variable.unit,
        description=variable.description,
        kind=_value_kind(variable),
        items=tuple(variable.literals.items()),
    )


def fixed_value(variable: Variable, value: float | str) -> float:
    """Return a fixed value after checking it.

    Raises:
        SpecError: if the variable's type or the FMU's min and max do not allow it.
    """
    with in_section(key="value"):
        if isinstance(value, str):
            raise SpecError(
                f"{value!r} is not a number, and {variable.name!r} is not a string but has the type "
                f"{variable.kind}"
            )
        _check_limits(variable, f"{value:g}", value, value)
        if not _contains_a_number(variable, value, value):
            expected = "one of " + items_text(variable) if variable.literals else "an integer"
            raise SpecError(f"{value:g}: expected {expected} for {variable.name!r}")
    return value


def _within(variable: Variable, limits: tuple[float, float]) -> tuple[float, float]:
    low, high = limits
    with in_section(key="range"):
        _check_limits(variable, f"[{low:g}, {high:g}]", low, high)
        if not _contains_a_number(variable, low, high):
            what = "item of the enumeration" if variable.literals else "integer"
            raise SpecError(f"[{low:g}, {high:g}] contains no {what}; widen the range")
    return low, high


def _check_limits(variable: Variable, shown: str, low: float, high: float) -> None:
    """Reject values outside the variable's type, its enumeration's items, or the FMU's min and max."""
    known, numbers = variable.type_limits, variable.literals.values()
    if known is not None and not known[0] <= low <= high <= known[1]:
        raise SpecError(
            f"{shown} exceeds the range of {variable.name!r}, which has the type {variable.type}, "
            f"[{known[0]}, {known[1]}]"
        )
    if numbers and not min(numbers) <= low <= high <= max(numbers):
        raise SpecError(
            f"{shown} exceeds the items of the enumeration {variable.name!r}: {items_text(variable)}"
        )
    if (variable.low is not None and low < variable.low) or (
        variable.high is not None and high > variable.high
    ):
        raise SpecError(
            f"{shown} exceeds the FMU's limits for {variable.name!r}, "
            f"[{_limit(variable.low)}, {_limit(variable.high)}]"
        )


def _contains_a_number(variable: Variable, low: float, high: float) -> bool:
    if variable.kind == "real":
        return True
    if variable.literals:
        return any(low <= number <= high for number in variable.literals.values())
    return floor(high) >= ceil(low)


def items_text(variable: Variable) -> str:
    """Return the numbers and names of an enumeration's items."""
    return ", ".join(f"{number} = {name}" for name, number in variable.literals.items())


def _value_kind(variable: Variable) -> ValueKind:
    if variable.kind == "string":
        raise SpecError(f"{variable.name!r} is a string; only numbers can be searched")
    return variable.kind


def _limit(value: float | None) -> str:
    return "no limit" if value is None else f"{value:g}"


def _check_unconnected(name: str, info: ModelInfo) -> None:
    source = next((source for source, target in info.connections if target == name), None)
    if source is not None:
        raise SpecError(f"this input is connected to {source}; remove this section or the connection")


def string_values(
    parameters: Mapping[str, ParameterSection], info: ModelInfo, folder: Path
) -> tuple[tuple[str, str], ...]:
    """Return the values of string parameters; files are named relative to the spec's folder."""
    return tuple(
        (name, named_file(v, folder) if isinstance(v := section.value, str) else f"{v:.17g}")
        for name, section in parameters.items()
        if section.value is not None and info[name].kind == "string"
    )


def _variable(name: str, variables: Iterable[Variable], otherwise: str) -> Variable:
    known = {v.name: v for v in variables}
    if name not in known:
        raise SpecError(f"{otherwise}; {did_you_mean(name, known)}")
    return known[name]
