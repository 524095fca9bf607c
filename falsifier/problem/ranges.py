"""From the ranges and values of a spec to what is searched, checked against the FMU's variables."""

from math import ceil, floor

from falsifier.core.model import Variable
from falsifier.core.space import Freedom, InputRange, ParameterRange, ValueKind
from falsifier.errors import SpecError
from falsifier.problem.spec import InputSection


def input_range(variable: Variable, section: InputSection, *, file: str | None, key: str) -> InputRange:
    """Searched input of a section, completed from the FMU's min, max, unit and description.

    Raises:
        SpecError: when range or control points cannot be known, or the range leaves the FMU's min/max.
    """
    limits = section.range
    if limits is None:
        least, most = variable.limits
        if least is None or most is None:
            raise SpecError(
                "the FMU gives no min and max for this input: add range = [low, high], or say "
                f"--input {variable.name}=LOW:HIGH[:POINTS]",
                file=file,
                key=f"{key}.range",
            )
        limits = (least, most)
    low, high = _within(variable, limits, file, f"{key}.range")
    if section.control_points is None:
        raise SpecError(
            "this key is missing: say how many evenly spaced control points the signal has",
            file=file,
            key=f"{key}.control_points",
        )
    discrete = variable.kind != "real"
    interpolation = section.interpolation or ("constant" if discrete else "pchip")
    if discrete and interpolation != "constant":
        raise SpecError(
            f'values of kind {variable.kind} cannot be interpolated: use "constant"',
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
    """Searched parameter, completed from what the FMU says of it.

    Raises:
        SpecError: when the range leaves what the FMU allows, or the type can hold.
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


def fixed_value(variable: Variable, value: float, *, file: str | None, key: str) -> float:
    """Return a value that is given once and for all.

    Raises:
        SpecError: when the variable's type cannot hold it.
    """
    _check_type(variable, f"{value:g}", (value, value), file, key)
    if variable.kind != "real" and not _holds_a_number(variable, value, value):
        expected = "one of " + _items(variable) if variable.literals else "a whole number"
        raise SpecError(f"{value:g}: expected {expected} for {variable.name!r}", file=file, key=key)
    return value


def _within(
    variable: Variable, limits: tuple[float, float], file: str | None, key: str
) -> tuple[float, float]:
    low, high = limits
    _check_type(variable, f"[{low:g}, {high:g}]", limits, file, key)
    if (variable.low is not None and low < variable.low) or (
        variable.high is not None and high > variable.high
    ):
        raise SpecError(
            f"[{low:g}, {high:g}] leaves the FMU's own limits for {variable.name!r}, "
            f"[{_limit(variable.low)}, {_limit(variable.high)}]",
            file=file,
            key=key,
        )
    if variable.kind != "real" and not _holds_a_number(variable, low, high):
        what = "item of the enumeration" if variable.literals else "whole number"
        raise SpecError(f"[{low:g}, {high:g}] holds no {what}: widen it", file=file, key=key)
    return low, high


def _check_type(
    variable: Variable, shown: str, limits: tuple[float, float], file: str | None, key: str
) -> None:
    """Refuse numbers that the variable's type cannot hold, or that none of its items reaches."""
    known = variable.type_limits
    if known is not None and not known[0] <= limits[0] <= limits[1] <= known[1]:
        raise SpecError(
            f"{shown} leaves the limits of the type {variable.type} of {variable.name!r}, "
            f"[{known[0]}, {known[1]}]",
            file=file,
            key=key,
        )
    numbers = variable.literals.values()
    if numbers and not min(numbers) <= limits[0] <= limits[1] <= max(numbers):
        raise SpecError(
            f"{shown} leaves the items of the enumeration {variable.name!r}: {_items(variable)}",
            file=file,
            key=key,
        )


def _holds_a_number(variable: Variable, low: float, high: float) -> bool:
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
