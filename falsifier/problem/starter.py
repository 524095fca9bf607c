"""Starter specs: valid spec files for an FMU, with comments on what to fill in."""

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Item, Table

from falsifier.core.literals import one_line
from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.problem.defaults import DEFAULT_POINTS, default_interface
from falsifier.problem.freedom import default_freedom
from falsifier.problem.grid import choose_grid
from falsifier.problem.requirement import PLACEHOLDER
from falsifier.problem.sections import FreeSection
from falsifier.stl.names import name_text

# Stop time in s if the FMU specifies none.
DEFAULT_STOP_TIME = 10.0
# Maximum number of parameters, and of variables to write requirements about, that are listed.
_SHOWN_PARAMETERS = 10
_SHOWN_VARIABLES = 20


def starter_spec(fmu: Path | Mapping[str, Path], info: ModelInfo) -> str:
    """Return the text of a spec file: valid but for its requirement; comments say what to fill in.

    Args:
        fmu: path of an FMU or SSP package; or of the FMUs of a system without connections, by component.
        info: what is known about the FMU or the system.

    Raises:
        SpecError: if there is nothing to search, or nothing to write a requirement about.
    """
    inputs = [v for v in info.inputs if v.kind != "string"]
    tunable = _tunable(info)
    if not inputs and not tunable:
        raise SpecError(
            f"{info.name}: nothing to search: the {info.noun} has no input, parameter or start value to set"
        )
    document = tomlkit.document()
    document.add(_comment(f"{info.name}: {info.description}" if info.description else info.name))
    document.add(tomlkit.nl())
    if isinstance(fmu, Path):
        document.add("model", _model_table(fmu, info))
    else:
        _add_components(document, fmu, info)
    if inputs:
        sections = tomlkit.table(is_super_table=True)
        free = _freedom(info)
        for v in inputs:
            sections.add(v.name, _input_table(v, free))
        document.add("inputs", sections)
    if tunable:
        document.add("parameters", _parameters_table(tunable, searched=() if inputs else tunable[:1]))
    requirements = tomlkit.table(is_super_table=True)
    requirements.add("R1", _requirement_table(info))
    document.add("requirements", requirements)
    return tomlkit.dumps(document)


def _tunable(info: ModelInfo) -> list[Variable]:
    """Return the parameters that can be set, or else the start values; real ones first."""
    settable = [v for v in info.variables if v.settable and v.kind != "string" and v.causality != "input"]
    parameters = [v for v in settable if v.causality == "parameter"]
    return sorted(parameters or settable, key=lambda v: v.kind != "real")


def _add_components(document: tomlkit.TOMLDocument, fmus: Mapping[str, Path], info: ModelInfo) -> None:
    components = tomlkit.table(is_super_table=True)
    for name, path in fmus.items():
        section = tomlkit.table()
        section.add("fmu", path.as_posix())
        section.add(_comment("step = SECONDS  # of its own; default: the communication step"))
        section.add(tomlkit.nl())
        components.add(name, section)
    document.add("components", components)
    connections = tomlkit.table()
    connections.add(_comment("INPUT = OUTPUT; an input that is connected needs no [inputs] section below:"))
    for v in info.inputs:
        component = v.name.removesuffix(_local(v.name))
        others = [o.name for o in info.outputs if o.kind == v.kind and not o.name.startswith(component)]
        near = [o for o in others if _local(o) == _local(v.name)]
        shown = " or ".join(f'"{o}"' for o in near or others[:_SHOWN_VARIABLES])
        connections.add(_comment(f'"{v.name}" = {shown or "OUTPUT"}'))
    connections.add(tomlkit.nl())
    document.add("connections", connections)
    document.add("model", _experiment_table(tomlkit.table(), info))


def _local(name: str) -> str:
    return name.rpartition(".")[2]


def _model_table(fmu: Path, info: ModelInfo) -> Table:
    table = tomlkit.table()
    table.add("fmu", fmu.as_posix())
    table.add("interface", default_interface(info) or "co-simulation")
    return _experiment_table(table, info)


def _experiment_table(table: Table, info: ModelInfo) -> Table:
    doubt = "" if info.stop_time else f"the {info.noun} specifies none: check this"
    table.add("stop_time", _noted(info.stop_time or DEFAULT_STOP_TIME, doubt))
    table.add(
        _comment("output_interval = SECONDS  # default: fits the FMU's step, the formulas and the stop time")
    )
    table.add(tomlkit.nl())
    return table


def _input_table(v: Variable, free: FreeSection) -> Table:
    table = tomlkit.table()
    meaning = ", ".join(part for part in (v.description, v.unit and f"in {v.unit}") if part)
    for line in (meaning, _items(v) if v.literals else ""):
        if line:
            table.add(_comment(line))
    low, high = _guessed(v)
    if low == high:
        table.add("value", low)
    else:
        doubt = (
            "" if v.is_bounded else "unbounded: the FMU specifies no min and max; replace with the real range"
        )
        table.add("range", _noted(_range(v, low, high), doubt))
        table.add("control_points", DEFAULT_POINTS)
        table.add("interpolation", "pchip" if v.kind == "real" else "constant")
        limits = tomlkit.inline_table()
        limits.update(free.model_dump())
        table.add(
            "free", _noted(limits, "engines may choose the control points; delete for the fixed ones above")
        )
    table.add(tomlkit.nl())
    return table


def _freedom(info: ModelInfo) -> FreeSection:
    """Return the limits that fit the placeholder requirement, whose window is the whole simulation."""
    stop_time = info.stop_time or DEFAULT_STOP_TIME
    step = choose_grid(stop_time, fmu_step=info.step_size).interval
    return default_freedom((), stop_time=stop_time, step=step)


def _guessed(v: Variable) -> tuple[float, float]:
    """Return the range of an input; what the FMU leaves open is one unit away from what it states."""
    least, most = v.limits
    if least is None:
        least = 0.0 if most is None else most - 1.0
    return least, least + 1.0 if most is None else most


def _parameters_table(tunable: Sequence[Variable], *, searched: Iterable[Variable]) -> Table:
    table = tomlkit.table()
    for v in searched:
        start = v.start if isinstance(v.start, int | float) else 0.0
        reach = max(abs(start), 1.0) / 2
        least, most = v.limits
        limits = _range(v, start - reach if least is None else least, start + reach if most is None else most)
        table.append(tomlkit.key([v.name, "range"]), _noted(limits, "replace with the real range"))
    table.add(_comment("Each may be searched, or fixed with NAME = NUMBER:"))
    for v in tunable[:_SHOWN_PARAMETERS]:
        low, high = v.limits
        shown = "[LOW, HIGH]" if low is None or high is None else str(_range(v, low, high))
        default = f"{v.start} {v.unit}".rstrip()
        table.add(_comment(f"{tomlkit.key(v.name).as_string()}.range = {shown}  # default: {default}"))
    table.add(tomlkit.nl())
    return table


def _range(v: Variable, low: float, high: float) -> list[float]:
    """Return a range; with integer bounds if the variable has only integer values."""
    return [float(low), float(high)] if v.kind == "real" else [floor(low), ceil(high)]


def _items(v: Variable) -> str:
    return ", ".join(f"{number} = {name}" for name, number in v.literals.items())


def _requirement_table(info: ModelInfo) -> Table:
    candidates = [v for v in info.observables if v.kind != "string"]
    if not candidates:
        raise SpecError(f"{info.name}: the FMU computes no variable that a requirement could be about")
    table = tomlkit.table()
    if not info.outputs:
        shown = ", ".join(name_text(v.name) for v in candidates[:_SHOWN_VARIABLES])
        more = ", ..." if len(candidates) > _SHOWN_VARIABLES else ""
        table.add(_comment(f"The FMU declares no outputs. Requirements may name any variable: {shown}{more}"))
    stop_time = info.stop_time or DEFAULT_STOP_TIME
    # Nothing may be searched, or found to hold, before somebody has said what is required.
    formula = f"G[0,{stop_time:.10g}] ({name_text(candidates[0].name)} <= {PLACEHOLDER})"
    table.add("formula", _noted(_formula_item(formula), "replace with the real requirement"))
    table.add("description", "")
    return table


def _formula_item(formula: str) -> Item:
    """Return a literal string, in which quotes need no escapes, if TOML allows that."""
    return tomlkit.string(formula, literal=formula.isprintable() and "'" not in formula)


def _noted(value: object, comment: str) -> Item:
    item: Item = tomlkit.item(value)
    if comment:
        item.comment(one_line(comment))
        item.trivia.comment_ws = "  "
    return item


def _comment(text: str) -> Any:
    return tomlkit.comment(one_line(text))
