"""Ranges and values of a spec, checked against the FMU's variables and completed from them."""

from collections.abc import Iterable, Mapping
from math import ceil, floor
from pathlib import Path

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace, ValueKind
from falsifier.errors import SpecError, did_you_mean
from falsifier.problem.sections import InputSection, ParameterSection
from falsifier.problem.shorthand import named_file

# Number of control points of an input of which nobody states it: both ends, the middle and two in between.
DEFAULT_POINTS = 5


def search_space(
    inputs: Mapping[str, InputSection],
    parameters: Mapping[str, ParameterSection],
    info: ModelInfo,
    stop_time: float,
    file: str,
) -> tuple[SearchSpace, dict[str, float]]:
    """Return what is searched, and the values of what is fixed.

    Args:
        inputs: the inputs' sections by name, as they hold after all overrides.
        parameters: the same of parameters and start values.
        info: the model's variables.
        stop_time: end of the simulation in s.
        file: name of the spec file, for errors.

    Raises:
        SpecError: naming the file, the key and the remedy.
    """
    searched: list[InputRange] = []
    fixed: dict[str, float] = {}
    for name, section in inputs.items():
        key = f"inputs.{name}"
        if name in info and info[name].alias_of:
            other = info[name].alias_of
            raise SpecError(
                f"the {info.noun} has one input with two names: use {other!r} instead", file=file, key=key
            )
        _check_unconnected(name, info, file, key)
        variable = _variable(name, info.inputs, f"the {info.noun} has no such input", file, key)
        if section.value is not None:
            fixed[name] = fixed_value(variable, section.value, file=file, key=f"{key}.value")
        else:
            searched.append(input_range(variable, section, file=file, key=key))
    ranges: list[ParameterRange] = []
    for name, parameter in parameters.items():
        key = f"parameters.{name}"
        if name in info and info[name].causality == "input":
            raise SpecError(f"{name} is an input; write [inputs.{name}]", file=file, key=key)
        settable = [v for v in info.variables if v.settable and v.causality != "input"]
        _check_unconnected(name, info, file, key)
        if name in info and not info[name].settable:
            v = info[name]
            reason = f"it is a {v.variability} {v.causality} of the {info.noun}"
            reason = f"it is another name of {v.alias_of!r}; use that one" if v.alias_of else reason
            raise SpecError(f"cannot be set: {reason}", file=file, key=key)
        variable = _variable(
            name, settable, f"the {info.noun} has no such parameter or start value", file, key
        )
        if variable.kind == "string" and parameter.value is not None:
            continue
        if parameter.range is not None:
            ranges.append(parameter_range(variable, parameter.range, file=file, key=f"{key}.range"))
        elif parameter.value is not None:
            fixed[name] = fixed_value(variable, parameter.value, file=file, key=f"{key}.value")
    return SearchSpace(tuple(searched), tuple(ranges), stop_time), fixed


def input_range(variable: Variable, section: InputSection, *, file: str | None, key: str) -> InputRange:
    """Return the searched input for a section, completed from the FMU's min, max, unit and description.

    Raises:
        SpecError: if range or control points are unknown, or the range exceeds the FMU's min and max.
    """
    limits = section.range
    if limits is None:
        smallest, largest = variable.limits
        if smallest is None or largest is None:
            raise SpecError(
                "the FMU specifies no min and max for this input; add range = [low, high] or "
                f"--search {variable.name}=LOW:HIGH[:POINTS]",
                file=file,
                key=f"{key}.range",
            )
        limits = (smallest, largest)
    low, high = _within(variable, limits, file, f"{key}.range")
    if section.control_points is None:
        raise SpecError(
            "this key is missing; specify the number of evenly spaced control points",
            file=file,
            key=f"{key}.control_points",
        )
    discrete = variable.kind != "real"
    interpolation = section.interpolation or ("constant" if discrete else "pchip")
    if discrete and interpolation != "constant":
        raise SpecError(
            f'values of type {variable.kind} cannot be interpolated; use "constant"',
            file=file,
            key=f"{key}.interpolation",
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


def parameter_range(
    variable: Variable, limits: tuple[float, float], *, file: str | None, key: str
) -> ParameterRange:
    """Return the searched parameter, completed from the FMU's start value, unit and description.

    Raises:
        SpecError: if the range exceeds the FMU's min and max, or the range of the variable's type.
    """
    low, high = _within(variable, limits, file, key)
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


def fixed_value(variable: Variable, value: float | str, *, file: str | None, key: str) -> float:
    """Return a fixed value after checking it.

    Raises:
        SpecError: if the variable's type or the FMU's min and max do not allow it.
    """
    if isinstance(value, str):
        raise SpecError(
            f"{value!r} is not a number, and {variable.name!r} is not a string but has the type "
            f"{variable.kind}",
            file=file,
            key=key,
        )
    _check_type(variable, f"{value:g}", (value, value), file, key)
    _check_limits(variable, f"{value:g}", (value, value), file, key)
    if variable.kind != "real" and not _contains_a_number(variable, value, value):
        expected = "one of " + _items(variable) if variable.literals else "an integer"
        raise SpecError(f"{value:g}: expected {expected} for {variable.name!r}", file=file, key=key)
    return value


def _within(
    variable: Variable, limits: tuple[float, float], file: str | None, key: str
) -> tuple[float, float]:
    low, high = limits
    _check_type(variable, f"[{low:g}, {high:g}]", limits, file, key)
    _check_limits(variable, f"[{low:g}, {high:g}]", limits, file, key)
    if variable.kind != "real" and not _contains_a_number(variable, low, high):
        what = "item of the enumeration" if variable.literals else "integer"
        raise SpecError(f"[{low:g}, {high:g}] contains no {what}; widen the range", file=file, key=key)
    return low, high


def _check_type(
    variable: Variable, shown: str, limits: tuple[float, float], file: str | None, key: str
) -> None:
    """Reject limits outside the range of the variable's type or of its enumeration's items."""
    known = variable.type_limits
    if known is not None and not known[0] <= limits[0] <= limits[1] <= known[1]:
        raise SpecError(
            f"{shown} exceeds the range of {variable.name!r}, which has the type {variable.type}, "
            f"[{known[0]}, {known[1]}]",
            file=file,
            key=key,
        )
    numbers = variable.literals.values()
    if numbers and not min(numbers) <= limits[0] <= limits[1] <= max(numbers):
        raise SpecError(
            f"{shown} exceeds the items of the enumeration {variable.name!r}: {_items(variable)}",
            file=file,
            key=key,
        )


def _check_limits(
    variable: Variable, shown: str, limits: tuple[float, float], file: str | None, key: str
) -> None:
    """Reject limits outside the FMU's min and max."""
    if (variable.low is not None and limits[0] < variable.low) or (
        variable.high is not None and limits[1] > variable.high
    ):
        raise SpecError(
            f"{shown} exceeds the FMU's limits for {variable.name!r}, "
            f"[{_limit(variable.low)}, {_limit(variable.high)}]",
            file=file,
            key=key,
        )


def _contains_a_number(variable: Variable, low: float, high: float) -> bool:
    if variable.literals:
        return any(low <= number <= high for number in variable.literals.values())
    return floor(high) >= ceil(low)


def _items(variable: Variable) -> str:
    return ", ".join(f"{number} = {name}" for name, number in variable.literals.items())


def _value_kind(variable: Variable) -> ValueKind:
    if variable.kind == "string":
        raise SpecError(f"{variable.name!r} is a string; only numbers can be searched")
    return variable.kind


def _limit(value: float | None) -> str:
    return "no limit" if value is None else f"{value:g}"


def _check_unconnected(name: str, info: ModelInfo, file: str, key: str) -> None:
    source = next((source for source, target in info.connections if target == name), None)
    if source is not None:
        raise SpecError(
            f"this input is connected to {source}; remove this section or the connection", file=file, key=key
        )


def string_values(
    parameters: Mapping[str, ParameterSection], info: ModelInfo, folder: Path
) -> tuple[tuple[str, str], ...]:
    """Return the values of string parameters; files are named relative to the spec's folder."""
    return tuple(
        (name, named_file(v, folder) if isinstance(v := section.value, str) else f"{v:.17g}")
        for name, section in parameters.items()
        if section.value is not None and info[name].kind == "string"
    )


def _variable(name: str, variables: Iterable[Variable], otherwise: str, file: str, key: str) -> Variable:
    known = {v.name: v for v in variables}
    if name not in known:
        raise SpecError(f"{otherwise}; {did_you_mean(name, known)}", file=file, key=key)
    return known[name]
