"""Ranges and values of a spec, checked against the FMU's variables and completed from them."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from falsifier.core.literals import shortest
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import Freedom, InputRange, ParameterRange, ValueKind
from falsifier.core.space import SearchSpace
from falsifier.errors import SpecError, did_you_mean, in_section, naming
from falsifier.problem.sections import InputSection, ModelChanges, ParameterSection, in_order
from falsifier.problem.shorthand import named_file, searching, stated_as

# Number of control points of an input of which nobody states it: both ends, the middle and two in between.
DEFAULT_POINTS = 5


def search_space(
    inputs: Mapping[str, InputSection],
    parameters: Mapping[str, ParameterSection],
    info: ModelInfo,
    stop_time: float,
    changes: ModelChanges,
) -> tuple[SearchSpace, dict[str, float]]:
    """Return what is searched, and the values of what is fixed.

    The sections are as they hold after all overrides; ``changes`` are what options or arguments state of
    them. The stop time is in s.

    Raises:
        SpecError: naming the key and the remedy.
    """
    searched: list[InputRange] = []
    ranges: list[ParameterRange] = []
    fixed: dict[str, float] = {}
    for name, section in inputs.items():
        with _stated("inputs", name, changes.inputs.get(name)):
            variable = _input(name, info)
            if section.value is not None:
                fixed[name] = _number(variable, section.value, "value")
            else:
                searched.append(_input_range(variable, section))
    for name, parameter in parameters.items():
        with _stated("parameters", name, changes.parameters.get(name)):
            variable = _parameter(name, info)
            if parameter.value is None:
                ranges.append(_parameter_range(variable, parameter))
            elif variable.kind != "string":
                fixed[name] = _number(variable, parameter.value, "value")
    return SearchSpace(tuple(searched), tuple(ranges), stop_time), fixed


@contextmanager
def _stated(kind: str, name: str, changed: InputSection | ParameterSection | None) -> Iterator[None]:
    """Let errors raised within name the option or argument that changes this, or else the spec's section."""
    place = changed and stated_as(kind, name, searched=changed.value is None)
    with naming(place or None), in_section(key=f"{kind}.{name}"):
        yield


def _input(name: str, info: ModelInfo) -> Variable:
    if name in info and info[name].alias_of:
        raise SpecError(f"the {info.noun} has one input with two names: use {info[name].alias_of!r} instead")
    _check_unconnected(name, info)
    if any(v.name == name for v in info.parameters):
        raise SpecError(f"{name} is a parameter; write parameters in place of inputs")
    variable = _variable(name, info.inputs, f"the {info.noun} has no such input")
    if variable.kind == "string":
        raise SpecError("this input is a string; it keeps its start value and cannot be set or searched")
    return variable


def _parameter(name: str, info: ModelInfo) -> Variable:
    """Return a parameter or start value that can be set."""
    if name in info and info[name].causality == "input":
        raise SpecError(f"{name} is an input; write inputs in place of parameters")
    _check_unconnected(name, info)
    if name in info and not info[name].settable:
        v = info[name]
        reason = v.refusal or f"it is a {v.variability} {v.causality} of the {info.noun}"
        reason = f"it is another name of {v.alias_of!r}; use that one" if v.alias_of else reason
        raise SpecError(f"cannot be set: {reason}")
    settable = [v for v in info.variables if v.settable and v.causality != "input"]
    return _variable(name, settable, f"the {info.noun} has no such parameter or start value")


def _check_unconnected(name: str, info: ModelInfo) -> None:
    source = next((source for source, target in info.connections if target == name), None)
    if source is not None:
        raise SpecError(f"this input is connected to {source}; leave it out, or remove the connection")


def _variable(name: str, variables: Iterable[Variable], otherwise: str) -> Variable:
    known = {v.name: v for v in variables}
    if name not in known:
        raise SpecError(f"{otherwise}; {did_you_mean(name, known)}")
    return known[name]


def _input_range(variable: Variable, section: InputSection) -> InputRange:
    """Return the searched input for a section, completed from the FMU's min, max, unit and description."""
    low, high = _ends(variable, section)
    discrete = variable.kind != "real"
    interpolation = section.interpolation or ("constant" if discrete else "pchip")
    if discrete and interpolation != "constant":
        raise SpecError(
            f'values of type {variable.kind} cannot be interpolated; use "constant"', key="interpolation"
        )
    free = Freedom(**section.free.model_dump()) if section.free else None
    usual = min(DEFAULT_POINTS, free.max_control_points) if free else DEFAULT_POINTS
    return InputRange(
        variable.name,
        low,
        high,
        control_points=section.control_points or usual,
        interpolation=interpolation,
        hold=section.hold,
        free=free,
        unit=variable.unit,
        description=variable.description,
        kind=value_kind(variable),
        items=variable.items,
    )


def _parameter_range(variable: Variable, section: ParameterSection) -> ParameterRange:
    """Return the searched parameter, completed from the FMU's min, max, start value, unit and description."""
    kind = value_kind(variable)
    return ParameterRange(
        variable.name,
        *_ends(variable, section),
        nominal=variable.start_number,
        unit=variable.unit,
        description=variable.description,
        kind=kind,
        items=variable.items,
        scale=section.scale or "linear",
    )


def _ends(variable: Variable, section: InputSection | ParameterSection) -> tuple[float, float]:
    """Return the ends of the range as numbers, by default the FMU's min and max."""
    low, high = variable.limits
    if section.range:
        low, high = (_number(variable, end, "range") for end in section.range)
        try:
            in_order((low, high))  # names have not been compared yet
        except ValueError as error:
            raise SpecError(str(error), key="range") from None
    if low is None or high is None:
        kind = _kind(variable)
        raise SpecError(
            f"the FMU specifies no min and max for this {kind.removesuffix('s')}; add its range: "
            f"{searching(kind, variable.name)}, or range = [low, high] in a spec",
            key="range",
        )
    _check(variable, "range", low, high)
    return low, high


def _number(variable: Variable, value: float | str, key: str) -> float:
    number = variable.number_of(value) if isinstance(value, str) else value
    if number is None:
        searched = f"{searching(_kind(variable), variable.name)}, or range = [low, high] in a spec"
        advice = f"; to search a range: {searched}" if key == "value" else ""
        raise SpecError(f"expected a number{variable.or_name}, got {value!r}{advice}", key=key)
    if key == "value":
        _check(variable, key, number)
    return number


def _kind(variable: Variable) -> str:
    return "inputs" if variable.causality == "input" else "parameters"


def _check(variable: Variable, key: str, *numbers: float) -> None:
    """Check the ends of a range, or a single value, against the variable's type and the FMU's min and max."""
    shown = f"{numbers[0]:.12g}" if key == "value" else "[{:.12g}, {:.12g}]".format(*numbers)
    # The start value may be stated again: the FMU has it, whatever its min and max.
    is_start = key == "value" and numbers[0] == variable.start_number
    limited = replace(variable, low=None, high=None) if is_start else variable
    if excess := limited.excess(numbers[0], numbers[-1]):
        raise SpecError(f"{shown} {excess}", key=key)
    # Whether a range contains such a number is checked by the range itself.
    if key == "value" and (expected := variable.expected(numbers[0])):
        raise SpecError(f"{shown}: {expected}", key=key)


def value_kind(variable: Variable) -> ValueKind:
    """Return the type of a variable's values; SpecError if they are texts."""
    if variable.kind == "string":
        raise SpecError(f"{variable.name!r} is a string; only numbers can be searched")
    return variable.kind


def string_values(
    parameters: Mapping[str, ParameterSection], info: ModelInfo, folder: Path
) -> tuple[tuple[str, str], ...]:
    """Return the values of string parameters; files are named relative to the spec's folder."""
    return tuple(
        (name, string_value(section.value, folder))
        for name, section in parameters.items()
        if section.value is not None and info[name].kind == "string"
    )


def string_value(given: float | str, folder: Path) -> str:
    """Return the text that a string gets; files are named relative to the folder."""
    return named_file(given, folder) if isinstance(given, str) else shortest(given)
