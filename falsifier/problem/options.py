"""Problems without a spec file: an FMU, a formula and a few options; and the starter spec of an FMU."""

from collections.abc import Iterable
from itertools import islice
from math import ceil, floor
from pathlib import Path

from falsifier.core.model import Interface, ModelInfo, Variable
from falsifier.core.signals import INTERPOLATIONS
from falsifier.errors import SpecError, did_you_mean, rejected
from falsifier.problem.loading import build_problem
from falsifier.problem.problem import Problem
from falsifier.problem.spec import ModelChanges, parse_spec
from falsifier.stl.names import name_text

# Control points of an input when nobody says how many: both ends, the middle and two between.
_DEFAULT_POINTS = 5
# Samples of the output grid when neither the user nor the FMU gives a step.
_DEFAULT_INTERVALS = 1000
# Seconds that the starter spec simulates when the FMU gives no stop time.
_DEFAULT_STOP_TIME = 10.0
# Bound of the starter spec's placeholder requirement when the FMU gives no max.
_UNREACHED = 1e9
# Parameters that the starter spec lists.
_SHOWN_PARAMETERS = 10


def changes_from_options(
    *,
    inputs: Iterable[str] = (),
    parameters: Iterable[str] = (),
    stop_time: float | None = None,
    output_interval: float | None = None,
    interface: Interface | None = None,
) -> ModelChanges:
    """Changes that command-line options ask for.

    Args:
        inputs: ``name=low:high``, ``name=low:high:points``, ``name=low:high:points:interpolation``
            (searched), ``name`` (searched as the spec says, or between the FMU's min and max) or
            ``name=value`` (kept constant).
        parameters: ``name=value`` (fixed) or ``name=low:high`` (searched).
        stop_time: in s.
        output_interval: in s.
        interface: how the FMU is simulated.

    Raises:
        SpecError: naming the option that cannot be read.
    """
    data: dict[str, object] = {
        "inputs": dict(_input(option) for option in inputs),
        "parameters": dict(_parameter(option) for option in parameters),
    }
    experiment = {"stop_time": stop_time, "output_interval": output_interval, "interface": interface}
    data |= {name: value for name, value in experiment.items() if value is not None}
    from pydantic import ValidationError

    try:
        return ModelChanges.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SpecError(f"{where}: {rejected(first['msg'], first['input'])}") from None


def adhoc_problem(fmu: Path, stl: str, *, changes: ModelChanges) -> Problem:
    """Problem of an FMU and a formula.

    Without any searched input or parameter all real inputs that have a min and a max are searched.

    Raises:
        SpecError: naming what cannot be known and the option that says it.
        ModelError: when the FMU cannot be read.
    """
    from falsifier.fmu import read_info

    if not fmu.is_file():
        raise SpecError(f"there is no file {fmu}")
    info = read_info(fmu)
    stop_time = changes.stop_time or info.stop_time
    if stop_time is None:
        raise SpecError(f"{fmu}: the FMU has no default stop time: give --stop-time SECONDS")
    searched = any(s.value is None for s in changes.inputs.values()) or any(
        s.range is not None for s in changes.parameters.values()
    )
    spec = parse_spec(
        {
            "model": {
                "fmu": str(fmu.resolve()),
                "interface": changes.interface or default_interface(info),
                "stop_time": stop_time,
                "output_interval": default_interval(info, stop_time),
            },
            "inputs": _searched_inputs(changes) if searched else _bounded_inputs(info),
            "requirements": {"stl": {"formula": stl}},
        },
        file=str(fmu),
    )
    if not searched and not spec.inputs:
        known = [v.name for v in info.inputs]
        raise SpecError(
            f"{fmu}: nothing to search: give --input NAME=LOW:HIGH:POINTS; {did_you_mean('', known)}"
        )
    return build_problem(spec, "stl", path=fmu, changes=changes)


def default_interface(info: ModelInfo) -> Interface | None:
    """Interface to use when nobody says which: co-simulation where the FMU offers it."""
    if "co-simulation" in info.interfaces:
        return "co-simulation"
    return info.interfaces[0] if info.interfaces else None


def default_interval(info: ModelInfo, stop_time: float) -> float:
    """Output interval in s: the FMU's step where it divides the stop time, else a thousandth of it."""
    step = info.step_size
    if step and stop_time / step >= 1 and abs(stop_time / step - round(stop_time / step)) < 1e-6:
        return step
    return stop_time / _DEFAULT_INTERVALS


def starter_spec(fmu: Path, info: ModelInfo) -> str:
    """Text of a spec file for an FMU: it loads as it is, and says in comments what to fill in."""
    inputs = [v for v in info.inputs if v.kind != "string"]
    tunable = sorted(
        (v for v in info.parameters if v.settable and v.kind != "string"), key=lambda v: v.kind != "real"
    )
    sections = [_model_section(fmu, info), *(_input_section(v) for v in inputs)]
    if tunable and not inputs:
        sections.append(_searched_parameter(tunable[0]))
    if tunable:
        sections.append(_parameter_hints(tunable))
    sections.append(_requirement_section(info))
    return "\n\n".join(sections) + "\n"


def _model_section(fmu: Path, info: ModelInfo) -> str:
    stop_time = info.stop_time or _DEFAULT_STOP_TIME
    doubt = "" if info.stop_time else "  # the FMU gives none: check this"
    about = f"# {info.name}: {info.description}\n\n" if info.description else f"# {info.name}\n\n"
    return (
        f'{about}[model]\nfmu = "{fmu.as_posix()}"\ninterface = "{default_interface(info)}"\n'
        f"stop_time = {stop_time!r}{doubt}\noutput_interval = {default_interval(info, stop_time)!r}"
    )


def _input_section(v: Variable) -> str:
    meaning = ", ".join(part for part in (v.description, v.unit and f"in {v.unit}") if part)
    comment = f"# {meaning}\n" if meaning else ""
    comment += f"# {_items(v)}\n" if v.literals else ""
    least, most = v.limits
    low, high = (0.0, 1.0) if least is None or most is None else (least, most)
    if low == high:
        return f"{comment}[inputs.{_toml_key(v.name)}]\nvalue = {low!r}"
    unknown = least is None or most is None
    doubt = "  # the FMU gives no min and max: put the real range here" if unknown else ""
    interpolation = "pchip" if v.kind == "real" else "constant"
    return (
        f"{comment}[inputs.{_toml_key(v.name)}]\nrange = {_range(v, low, high)}{doubt}\n"
        f'control_points = {_DEFAULT_POINTS}\ninterpolation = "{interpolation}"'
    )


def _searched_parameter(v: Variable) -> str:
    start = v.start if isinstance(v.start, int | float) else 0.0
    reach = max(abs(start), 1.0) / 2
    least, most = v.limits
    low = start - reach if least is None else least
    high = start + reach if most is None else most
    return f"[parameters.{_toml_key(v.name)}]  # put the real range here\nrange = {_range(v, low, high)}"


def _range(v: Variable, low: float, high: float) -> str:
    """A range in TOML; of whole numbers where the variable has no others."""
    if v.kind == "real":
        return f"[{float(low)!r}, {float(high)!r}]"
    return f"[{floor(low)}, {ceil(high)}]"


def _items(v: Variable) -> str:
    return ", ".join(f"{number} = {name}" for name, number in v.literals.items())


def _parameter_hints(parameters: Iterable[Variable]) -> str:
    hints = ["# Parameters may be searched, or fixed with value = NUMBER:"]
    for v in islice(parameters, _SHOWN_PARAMETERS):
        low, high = v.limits
        limits = "[LOW, HIGH]" if low is None or high is None else _range(v, low, high)
        hints.append(
            f"# parameters.{_toml_key(v.name)}.range = {limits}  # starts at {v.start} {v.unit}".rstrip()
        )
    return "\n".join(hints)


def _requirement_section(info: ModelInfo) -> str:
    output = next((v for v in info.outputs if v.kind != "string"), None)
    if output is None:
        raise SpecError(f"{info.name}: the FMU has no output that a requirement could speak of")
    bound = _UNREACHED if output.high is None else output.high
    stop_time = info.stop_time or _DEFAULT_STOP_TIME
    return (
        "[requirements.R1]\n"
        f"formula = 'G[0,{stop_time:.10g}] ({name_text(output.name)} <= {bound:.10g})'"
        '  # put the real requirement here\ndescription = ""'
    )


def _input(option: str) -> tuple[str, dict[str, object]]:
    if option.strip() and "=" not in option:
        return option.strip(), {}
    name, parts = _split(option, "--input")
    if len(parts) == 1:
        return name, {"value": _number(parts[0], option)}
    section: dict[str, object] = {"range": (_number(parts[0], option), _number(parts[1], option))}
    section["control_points"] = _DEFAULT_POINTS
    if len(parts) > 2:
        if not parts[2].isdigit():
            raise SpecError(f"--input {option}: {parts[2]!r} is not a number of control points")
        section["control_points"] = int(parts[2])
    if len(parts) > 3:
        if parts[3] not in INTERPOLATIONS:
            raise SpecError(f"--input {option}: {did_you_mean(parts[3], INTERPOLATIONS)}")
        section["interpolation"] = parts[3]
    if len(parts) > 4:
        raise SpecError(f"--input {option}: expected NAME=LOW:HIGH:POINTS:INTERPOLATION")
    return name, section


def _parameter(option: str) -> tuple[str, dict[str, object]]:
    name, parts = _split(option, "--param")
    if len(parts) == 1:
        return name, {"value": _number(parts[0], option)}
    if len(parts) == 2:
        return name, {"range": (_number(parts[0], option), _number(parts[1], option))}
    raise SpecError(f"--param {option}: expected NAME=VALUE or NAME=LOW:HIGH")


def _split(option: str, flag: str) -> tuple[str, list[str]]:
    name, equals, rest = option.partition("=")
    if not equals or not name.strip() or not rest.strip():
        raise SpecError(f"{flag} {option}: expected NAME=..., for example throttle=0:100:7")
    return name.strip(), rest.strip().split(":")


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise SpecError(f"{option}: {text!r} is not a number") from None


def _bounded_inputs(info: ModelInfo) -> dict[str, object]:
    return {
        v.name: {"control_points": _DEFAULT_POINTS}
        for v in info.inputs
        if v.kind == "real" and v.low is not None and v.high is not None
    }


def _searched_inputs(changes: ModelChanges) -> dict[str, object]:
    return {
        name: {"control_points": _DEFAULT_POINTS}
        for name, section in changes.inputs.items()
        if section.value is None
    }


def _toml_key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else f'"{name}"'
