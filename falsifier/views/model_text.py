"""What people see of a model: what an FMU says of itself, as text or JSON.

The tables are plain text: a table library needs minutes for the 100,000 variables of large models.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields

from falsifier.core.model import ModelInfo, Variable

# Rows of a table, unless all are asked for; models have thousands of parameters.
_SHOWN_VARIABLES = 60
_NO_INTERFACE = "no interface that can be simulated (scheduled execution is not supported)"
_COLUMNS = ("name", "type", "unit", "min", "max", "start", "description")
_RIGHT_ALIGNED = ("min", "max", "start")
# Longer cells are not padded to; they push their row to the right.
_WIDEST_COLUMN = 40


def info_text(info: ModelInfo, *, everything: bool = False) -> str:
    """Return what an FMU says of itself for people.

    Args:
        info: the description.
        everything: whether to list all variables, internal ones too.
    """
    return "\n".join(_lines(info, everything=everything))


def info_json(info: ModelInfo) -> str:
    """Return the description of a model as JSON."""
    content = {field.name: getattr(info, field.name) for field in fields(info)}
    names = [field.name for field in fields(Variable)]
    content["variables"] = [{name: getattr(v, name) for name in names} for v in info.variables]
    return json.dumps(content, indent=2)


def _lines(info: ModelInfo, *, everything: bool) -> Iterator[str]:
    yield f"{info.name}  FMI {info.fmi_version}, {', '.join(info.interfaces) or _NO_INTERFACE}"
    if info.description:
        yield info.description
    yield f"platforms: {', '.join(info.platforms) or 'none'}; made by {info.tool or 'unknown'}"
    experiment = (
        f"{label} {value:g}{unit}"
        for label, value, unit in (
            ("start time", info.start_time or None, " s"),
            ("stop time", info.stop_time, " s"),
            ("step", info.step_size, " s"),
            ("tolerance", info.tolerance, ""),
        )
        if value is not None
    )
    yield f"default experiment: {', '.join(experiment) or 'none'}"
    yield from (f"note: {note}" for note in info.notes)
    groups = {
        "inputs": info.inputs,
        "outputs": info.outputs,
        "parameters": info.parameters,
        "states": tuple(v for v in info.variables if v.is_state),
    }
    if everything or not info.outputs:
        shown = {v.name for group in groups.values() for v in group}
        groups["other variables"] = tuple(v for v in info.variables if v.name not in shown)
    for title, variables in groups.items():
        limit = len(variables) if everything else _SHOWN_VARIABLES
        if variables:
            yield title
            yield from _table(variables[:limit])
        if len(variables) > limit:
            yield f"... and {len(variables) - limit} more {title}: --all shows them"


def _table(variables: Sequence[Variable]) -> Iterator[str]:
    rows = [_COLUMNS, *map(_cells, variables)]
    widths = [min(max(map(len, column)), _WIDEST_COLUMN) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (
            cell.rjust(width) if column in _RIGHT_ALIGNED else cell.ljust(width)
            for column, cell, width in zip(_COLUMNS, row, widths, strict=True)
        )
        yield "  ".join(cells).rstrip()


def _cells(v: Variable) -> tuple[str, ...]:
    unit = f"{v.unit} (shown in {v.display_unit})" if v.display_unit else v.unit
    low, high = _number(v.low), _number(v.high)
    if v.causality == "input" and v.kind == "real":
        low, high = low or "unbounded", high or "unbounded"
    description = " ".join(v.description.split())
    return (v.name, v.kind, unit, low, high, _number(v.start), description)


def _number(value: float | str | None) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, int | float) else value
