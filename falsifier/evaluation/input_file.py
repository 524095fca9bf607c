"""Input signals from a CSV file: a test from the field, or the input.csv of an exported counterexample."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from pathlib import Path

from falsifier.core.literals import csv_cell, number_in
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.signals import Signal, step_ramp
from falsifier.errors import SpecError, did_you_mean, in_section, written
from falsifier.problem.unit_check import spelled
from falsifier.stl.lexer import UNITS

# The first name of a table, quoted or not, and what separates it from the next one.
_SEPARATED = re.compile(r'\s*(?:"[^"]*"|[^",;\t]*)([,;\t])')
# Numbers with decimal commas, as German spreadsheets write them, and a number with a point.
_WITH_COMMA, _WITH_POINT = re.compile(r"[-+\deE, ]*\d,\d[-+\deE, ]*"), re.compile(r"[-+\deE]*\.[-+\deE]*")
# The last word of the name of a column, such as "t [ms]", "time_min", "Time.h" or "ms".
_UNIT = re.compile(r"([^\W_]+)\W*$")


@dataclass(frozen=True, slots=True)
class InputFile:
    """The inputs in a file."""

    signals: Mapping[str, Signal]  # input signals by name
    unused: tuple[str, ...]  # columns that are variables of the model, but not inputs
    end: float  # time of the last row in s; after it, inputs keep their last values

    def notes(self, stop_time: float) -> list[str]:
        """Say what of the file a simulation until a time in s does not use, or has to add to it."""
        told = [f"not inputs of the model, and not used: {', '.join(self.unused)}"] if self.unused else []
        if self.end > stop_time:
            option = written("--stop-time", "stop_time")
            told += [f"ends at {self.end:.12g} s, the simulation at {stop_time:.12g} s: see {option}"]
        if 0.0 < self.end < stop_time:
            told += [f"ends at {self.end:.12g} s; the last values are kept until {stop_time:.12g} s"]
        return told


def read_inputs(path: Path, info: ModelInfo) -> InputFile:
    """Read input signals from a CSV file.

    The first row has the names. The first column is the time in s, from 0 on; a repeated time is a step. Each
    further column is one input, linear between two rows; inputs that are not real hold their values, also
    given by the names of items. An array may be one column, with spaces between its elements. Columns may
    also be separated by semicolons or tabs, and then have decimal commas.

    Raises:
        SpecError: naming the file, the row or column and what is wrong.
    """
    with in_section(file=str(path)):
        return _read(csv_rows(path), info)


def csv_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file that are not empty, numbered from 1; SpecError if it is none.

    Empty columns at the end, which spreadsheets write where something once stood, are left out.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        mark = found[1] if (found := _SEPARATED.match(text)) else ","
        lines = list(enumerate(csv.reader(StringIO(text), delimiter=mark), 1))
        width = max((k for _, row in lines for k, c in enumerate(row, 1) if c.strip()), default=0)
        rows = [(n, row[:width]) for n, row in lines if any(c.strip() for c in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else "expected a CSV file in UTF-8"
        raise SpecError(f"cannot be read: {reason}", file=str(path)) from None
    with in_section(file=str(path)):
        return rows if mark == "," else _with_points(rows)


def _with_points(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """Return the rows with points in place of decimal commas; SpecError if there are both."""
    if not any(_WITH_COMMA.fullmatch(cell) for _, row in rows[1:] for cell in row):
        return rows
    for n, row in rows[1:]:
        if pointed := next((cell for cell in row if _WITH_POINT.fullmatch(cell.strip())), None):
            raise SpecError(
                f"row {n}: {pointed!r} has a point, other numbers have decimal commas: write all in one way, "
                "without marks between thousands"
            )
        row[:] = [cell.replace(",", ".") if _WITH_COMMA.fullmatch(cell) else cell for cell in row]
    return rows


def _read(rows: Sequence[tuple[int, list[str]]], info: ModelInfo) -> InputFile:
    """Read the rows of a file, given with their numbers from 1."""
    if len(rows) < 2:
        raise SpecError("expected a row of names and one or more rows of numbers")
    header = [cell.strip() for cell in rows[0][1]]
    role = info[header[0]].causality if header[0] in info else "independent"
    if header[0].lower() not in ("t", "time") and role != "independent":
        raise SpecError(f"the first column must be the time in s, got the {role} {header[0]!r}")
    unit = spelled(found[1].replace("µ", "u")) if (found := _UNIT.search(header[0])) else "s"
    if UNITS.get(unit, 1) != 1:
        raise SpecError(f"the time must be in s, got {header[0]!r}: multiply it by {UNITS[unit]:f}")
    if unnamed := next((n for n, name in enumerate(header[1:], 2) if not name), None):
        raise SpecError(f"column {unnamed} has no name: write one into row {rows[0][0]}, or drop the column")
    columns = [_inputs_of(name, info) for name in header[1:]]
    named = [v.name for column in columns for v in column]
    if twice := next((name for name in named if named.count(name) > 1), None):
        raise SpecError(f"input {twice} is given by two columns; drop one of them")
    times: list[float] = []
    values: dict[str, list[float]] = {name: [] for name in named}
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise SpecError(f"row {line}: {len(row)} cells, expected {len(header)} as in row {rows[0][0]}")
        times.append(_time(row[0], times, line))
        for name, cell, column in zip(header[1:], row[1:], columns, strict=True):
            if column:
                _append(values, column, cell, f"row {line}, column {name}")
    if not values:
        known = did_you_mean("", (v.name for v in info.inputs))
        raise SpecError(f"no column is an input of the model; {known}")
    signals = {name: _signal(times, column, info[name]) for name, column in values.items()}
    unused = tuple(name for name, column in zip(header[1:], columns, strict=True) if not column)
    return InputFile(signals, unused, times[-1])


def _inputs_of(column: str, info: ModelInfo) -> list[Variable]:
    """Return the inputs that a column stands for: one, the elements of an array, or none."""
    # A spreadsheet-safe file has an apostrophe before some names.
    exact = [v for v in info.inputs if column in (v.name, csv_cell(v.name))]
    found = exact or [v for v in info.inputs if v.name.startswith(f"{column}[")]
    if found or column in info:
        return found
    near = did_you_mean(column, (v.name for v in info.inputs))
    raise SpecError(f"column {column!r}: the model has no such input; {near}")


def _time(cell: str, before: Sequence[float], line: int) -> float:
    time = _number(cell, f"row {line}: time")
    if not before and time != 0.0:
        raise SpecError(f"row {line}: the first time must be 0 s, got {time:.12g} s: shift it")
    if before and time < before[-1]:
        raise SpecError(
            f"row {line}: time {time:.12g} s is before {before[-1]:.12g} s: sort the rows by time"
        )
    return time


def _append(values: Mapping[str, list[float]], column: Sequence[Variable], cell: str, what: str) -> None:
    parts = cell.split() if len(column) > 1 else [cell.strip()]  # names of items may have spaces
    if not any(parts):
        raise SpecError(
            f"{what}: the cell is empty; expected {'a number' if len(column) == 1 else 'numbers'}"
        )
    if len(parts) != len(column):
        raise SpecError(f"{what}: {len(parts)} numbers, expected {len(column)}")
    for variable, part in zip(column, parts, strict=True):
        named = variable.number_of(part)
        number = _number(part, what, variable.or_name) if named is None else named
        if expected := variable.expected(number):
            raise SpecError(f"{what}: {number:.12g}: {expected}")
        values[variable.name].append(number)


def _number(text: str, what: str, others: str = "") -> float:
    if (number := number_in(text)) is None:
        raise SpecError(f"{what}: expected a number{others}, got {text!r}")
    return number


def _signal(times: Sequence[float], values: Sequence[float], variable: Variable) -> Signal:
    """Return the signal through the rows, without rows that change nothing."""
    points = list(zip(times, values, strict=True))
    flat = all(b[1] == a[1] or b[0] == a[0] for a, b in pairwise(points))
    if flat or variable.kind != "real":
        last = list(dict(points).items())  # of several values at one time the last one counts
        changes = [last[0], *(b for a, b in pairwise(last) if b[1] != a[1])]
        return Signal(tuple(t for t, _ in changes), tuple(v for _, v in changes), "constant")
    return _sloped(points)


def _sloped(points: Sequence[tuple[float, float]]) -> Signal:
    """Return a piecewise linear signal whose steps are steep ramps."""
    kept: list[tuple[float, float]] = []
    for time, value in points:
        if kept and kept[-1][0] == time:
            before = kept.pop()
            start = time - step_ramp(time)
            if before[1] != value and kept and kept[-1][0] < start:
                kept.append((start, before[1]))
        # Between two points of the same value, a third one changes nothing.
        if len(kept) > 1 and kept[-2][1] == kept[-1][1] == value:
            kept.pop()
        kept.append((time, value))
    return Signal(tuple(t for t, _ in kept), tuple(v for _, v in kept), "linear")
