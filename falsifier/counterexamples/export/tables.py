"""Inputs as they were applied, and start values, as tables in the formats of other tools."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import nan
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.files import write_whole
from falsifier.core.literals import csv_cell, plain
from falsifier.core.model import Kind, Model, ModelInfo, Variable
from falsifier.core.signals import TIME_ROUNDING, Signal
from falsifier.fmu import FmuModel, is_solved
from falsifier.problem.problem import Problem

# Rows of a curve that a solver follows, at least.
_CURVE_ROWS = 1000
_SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"


@dataclass(frozen=True, slots=True)
class InputTable:
    """Input signals over time, linear between two rows."""

    times: NDArray[np.float64]  # in s, shape (n,), from 0 to the stop time; a repeated time is a step
    columns: Mapping[str, NDArray[np.float64]]  # one array of shape (n,) per input, by name


def input_table(problem: Problem, candidate: Candidate) -> InputTable:
    """Make a table of all numeric inputs of the model whose values are known, constant ones too.

    The rows are the communication points, at which inputs are set; of a solver here, which evaluates them at
    any time, also the times at which their pieces begin. Held and piecewise constant signals step
    there: one row with the value before and one with the value after. Redundant rows are omitted.
    """
    experiment = problem.experiment
    steps = round(experiment.stop_time / experiment.step)
    times = np.arange(steps + 1, dtype=np.float64) * np.float64(experiment.stop_time / steps)
    if is_solved(problem.model):
        times = np.union1d(times, _beginnings(problem, candidate))
    columns = {}
    for variable in problem.info.inputs:
        after = _values(problem, candidate, variable, times)
        if after is not None:
            signal = candidate.signals.get(variable.name)
            stepped = signal is not None and (
                signal.hold is not None or signal.interpolation == "constant" or variable.kind != "real"
            )
            before = np.concatenate((after[:1], after[:-1])) if stepped else after
            columns[variable.name] = np.stack((before, after), axis=1).ravel()
    rows = np.stack((np.repeat(times, 2), *columns.values()))
    kept = np.concatenate(([True], (np.diff(rows) != 0.0).any(axis=0)))
    # A step at the stop time has no effect: the last inputs are set one communication step earlier.
    kept[-1] = False
    rows = rows[:, kept]
    same = (np.diff(rows[1:]) == 0.0).all(axis=0)
    rows = rows[:, np.concatenate(([True], ~(same[:-1] & same[1:]), [True]))]
    return InputTable(rows[0], dict(zip(columns, rows[1:], strict=True)))


def start_values(problem: Problem, candidate: Candidate) -> dict[str, float | str]:
    """Parameters, strings and start values that are given, by name; all others are the model's own."""
    inputs = {v.name for v in problem.info.inputs}
    settings: dict[str, float | str] = {**problem.parameters, **candidate.parameters}
    settings |= dict(problem.experiment.strings)
    return {name: value for name, value in settings.items() if name not in inputs}


def is_curve(signal: Signal) -> bool:
    """Whether a signal has other values between its control points, or between two samples."""
    return signal.hold is None and signal.interpolation != "constant" and len(signal.times) > 1


def _beginnings(problem: Problem, candidate: Candidate) -> NDArray[np.float64]:
    """Return the times in s at which pieces of continuous inputs begin between the communication points."""
    experiment, info = problem.experiment, problem.info
    signals = [s for name, s in candidate.signals.items() if info[name].is_continuous]
    found = [s.pieces(experiment.stop_time)[:, 0] for s in signals]
    if any(s.interpolation == "pchip" and is_curve(s) for s in signals):
        found.append(np.linspace(0.0, experiment.stop_time, _CURVE_ROWS + 1))
    begins = np.concatenate([*found, experiment.times[:1]])
    apart = np.abs(begins - np.rint(begins / experiment.step) * experiment.step)
    is_apart = apart > TIME_ROUNDING * begins.clip(max=1.0)
    return begins[is_apart & (begins < experiment.stop_time)]


def _values(
    problem: Problem, candidate: Candidate, variable: Variable, times: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    if variable.name in candidate.signals:
        signal = candidate.signals[variable.name]
        if is_solved(problem.model) and not variable.is_continuous:
            grid = problem.experiment.times  # on which a solver changes it
            times = grid[np.searchsorted(grid, times * (1.0 + TIME_ROUNDING), side="right") - 1]
        values = signal.sample(times)
        return values if variable.kind == "real" else np.rint(values)
    value = problem.parameters.get(variable.name, variable.start_number)
    return None if value is None else np.full(times.shape, float(value))


def file_columns(table: InputTable, model: Model) -> dict[str, list[NDArray[np.float64]]]:
    """Return the columns of input.csv after the time: of each input its elements, shape (rows,) each."""

    def column(name: str) -> NDArray[np.float64]:
        if name in table.columns:
            return table.columns[name]
        is_omitted = model.info[name].causality == "output"  # all other outputs are in the table
        return np.full(table.times.shape, nan if is_omitted else model.info[name].start_number or 0.0)

    declarations = _by_declaration(model, table.columns).items()
    return {declared: [column(e) for e in elements] for declared, elements in declarations}


def write_csv(table: InputTable, path: Path, model: Model) -> Path:
    """Write the inputs with a header of quoted names; numbers are written with full precision.

    Arrays of the FMU are one column each, with a space between two elements.
    """
    # Pairs, as an input may be named time, too.
    columns = [("time", [table.times]), *file_columns(table, model).items()]
    lines = [",".join('"' + csv_cell(name).replace('"', '""') + '"' for name, _ in columns)]
    cells = [np.stack(column, axis=1).tolist() for _, column in columns]
    lines += [",".join(" ".join(map(repr, cell)) for cell in row) for row in zip(*cells, strict=True)]
    return write_whole(path, "\n".join(lines) + "\n")


def write_json(start: Mapping[str, float | str], path: Path, model: Model) -> Path:
    """Write the start values as one JSON object; arrays of the FMU are lists of all elements."""
    texts = {name: value for name, value in start.items() if isinstance(value, str)}
    shown: dict[str, object] = {**texts}
    for declared, elements in _by_declaration(model, [n for n in start if n not in texts]).items():
        values = [start[e] if e in start else model.info[e].start_number or 0.0 for e in elements]
        shown[declared] = values if len(values) > 1 else values[0]
    return write_whole(path, json.dumps(shown, indent=2) + "\n")


def text_of(value: float | str, kind: Kind) -> str:
    """Return a start value as scripts and parameter sets have it: a whole number, ``true``, a text."""
    if isinstance(value, str) or kind == "real":
        return value if isinstance(value, str) else repr(float(value))
    return str(bool(value)).lower() if kind == "boolean" else str(round(value))


def write_ssv(
    start: Mapping[str, float | str], name: str, path: Path, info: ModelInfo, *, named: bool = True
) -> Path:
    """Write the start values as a parameter set of System Structure and Parameterization 1.0."""
    root = parameter_set(start, name, info, named=named)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    return path


def parameter_set(
    start: Mapping[str, float | str], name: str, info: ModelInfo, *, named: bool
) -> ElementTree.Element:
    """Return the start values as an XML element of that standard.

    Of enumerations, items are ``named``, or else numbers, as connectors have them.
    """
    ElementTree.register_namespace("ssv", _SSV)
    root = ElementTree.Element(f"{{{_SSV}}}ParameterSet", {"version": "1.0", "name": plain(name)})
    parameters = ElementTree.SubElement(root, f"{{{_SSV}}}Parameters")
    for key, value in start.items():
        parameter = ElementTree.SubElement(parameters, f"{{{_SSV}}}Parameter", {"name": plain(key)})
        variable = info[key] if key in info else Variable(key, "string" if isinstance(value, str) else "real")
        items = {number: item for item, number in variable.literals.items() if named}
        text = items.get(round(value), "") if items and not isinstance(value, str) else ""
        kind = "integer" if variable.kind == "enumeration" and not text else variable.kind
        written = {"value": plain(text or text_of(value, kind))}
        ElementTree.SubElement(parameter, f"{{{_SSV}}}{kind.capitalize()}", written)
    return root


def write_mat(table: InputTable, start: Mapping[str, float | str], path: Path) -> Path:
    """Write inputs and start values for MATLAB, whose names of variables cannot be the model's.

    ``inputs`` is a matrix of the time and one column per input, as Simulink takes it for root inports; a
    repeated time is a step. ``input_names`` names the columns after it, ``start_names`` the ``start_values``.
    """
    from scipy.io import savemat

    content = {"input_names": table.columns, "start_names": start, "start_values": start.values()}
    cells = {
        name: np.array([plain(v) if isinstance(v, str) else v for v in values], dtype=object)
        for name, values in content.items()
    }
    savemat(path, {"inputs": np.stack((table.times, *table.columns.values()), axis=1), **cells})
    return path


def _by_declaration(model: Model, names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return all elements of each variable, as the FMU declares it, of which an element is named."""
    if not isinstance(model, FmuModel):
        return {name: (name,) for name in names}
    declared = dict.fromkeys(model.place(name)[0] for name in names)
    return {name: model.elements(name) for name in declared}
