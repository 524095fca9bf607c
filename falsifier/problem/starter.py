"""Starter specs: valid spec files for an FMU, with comments on what to fill in."""

from collections.abc import Iterable
from itertools import islice
from math import ceil, floor
from pathlib import Path

from falsifier.core.literals import one_line, toml_key, toml_string
from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.problem.defaults import DEFAULT_POINTS, default_interface, default_interval
from falsifier.stl.names import name_text

# Stop time in s if the FMU specifies none.
_DEFAULT_STOP_TIME = 10.0
# Bound of the placeholder requirement if the FMU specifies no max; no real output reaches it.
_UNREACHED = 1e9
# Maximum number of parameters that are listed.
_SHOWN_PARAMETERS = 10


def starter_spec(fmu: Path, info: ModelInfo) -> str:
    """Return the text of a spec file for an FMU: it is valid as it is; comments say what to fill in."""
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
    doubt = "" if info.stop_time else "  # the FMU specifies none: check this"
    about = f"{info.name}: {info.description}" if info.description else info.name
    return (
        f"# {one_line(about)}\n\n[model]\nfmu = {toml_string(fmu.as_posix())}\n"
        f'interface = "{default_interface(info)}"\n'
        f"stop_time = {stop_time!r}{doubt}\noutput_interval = {default_interval(info, stop_time)!r}"
    )


def _input_section(v: Variable) -> str:
    meaning = ", ".join(part for part in (v.description, v.unit and f"in {v.unit}") if part)
    comment = f"# {one_line(meaning)}\n" if meaning else ""
    comment += f"# {one_line(_items(v))}\n" if v.literals else ""
    least, most = v.limits
    low, high = (0.0, 1.0) if least is None or most is None else (least, most)
    if low == high:
        return f"{comment}[inputs.{toml_key(v.name)}]\nvalue = {low!r}"
    unknown = least is None or most is None
    doubt = "  # the FMU specifies no min and max: replace with the real range" if unknown else ""
    interpolation = "pchip" if v.kind == "real" else "constant"
    return (
        f"{comment}[inputs.{toml_key(v.name)}]\nrange = {_range(v, low, high)}{doubt}\n"
        f'control_points = {DEFAULT_POINTS}\ninterpolation = "{interpolation}"'
    )


def _searched_parameter(v: Variable) -> str:
    start = v.start if isinstance(v.start, int | float) else 0.0
    reach = max(abs(start), 1.0) / 2
    least, most = v.limits
    low = start - reach if least is None else least
    high = start + reach if most is None else most
    return f"[parameters.{toml_key(v.name)}]  # replace with the real range\nrange = {_range(v, low, high)}"


def _range(v: Variable, low: float, high: float) -> str:
    """Return a range in TOML; with integer bounds if the variable has only integer values."""
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
        default = one_line(f"default: {v.start} {v.unit}")
        hints.append(f"# parameters.{toml_key(v.name)}.range = {limits}  # {default}")
    return "\n".join(hints)


def _requirement_section(info: ModelInfo) -> str:
    output = next((v for v in info.outputs if v.kind != "string"), None)
    if output is None:
        raise SpecError(f"{info.name}: the FMU has no numeric output to write a requirement about")
    bound = _UNREACHED if output.high is None else output.high
    stop_time = info.stop_time or _DEFAULT_STOP_TIME
    formula = f"G[0,{stop_time:.10g}] ({name_text(output.name)} <= {bound:.10g})"
    return (
        f"[requirements.R1]\nformula = {toml_string(formula)}"
        '  # replace with the real requirement\ndescription = ""'
    )
