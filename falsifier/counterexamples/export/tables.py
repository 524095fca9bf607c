"""Input tables and start values in the formats of other tools."""

import json
import re
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from falsifier.core.literals import csv_cell, plain
from falsifier.core.model import Model
from falsifier.counterexamples.export.arrays import by_declaration, start_of
from falsifier.counterexamples.export.inputs import InputTable

_SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_MATLAB_NAME_LENGTH = 63
_MATLAB_KEYWORDS = (
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global",
    "if", "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
)  # fmt: skip


def file_columns(table: InputTable, model: Model) -> dict[str, list[NDArray[np.float64]]]:
    """Return the columns of input.csv after the time: of each input its elements, shape (rows,) each."""
    return by_declaration(
        model, table.columns, lambda name: np.full(table.times.shape, start_of(model, name))
    )


def write_csv(table: InputTable, path: Path, model: Model) -> Path:
    """Write the inputs with a header of quoted names; numbers are written with full precision.

    Arrays of the FMU are one column each, with a space between two elements.
    """
    columns = {"time": [table.times], **file_columns(table, model)}
    lines = [",".join('"' + csv_cell(name).replace('"', '""') + '"' for name in columns)]
    cells = [np.stack(column, axis=1).tolist() for column in columns.values()]
    lines += [",".join(" ".join(map(repr, cell)) for cell in row) for row in zip(*cells, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_json(start: Mapping[str, float | str], path: Path, model: Model | None = None) -> Path:
    """Write the start values as one JSON object; arrays of the FMU are lists of all elements."""
    shown: dict[str, object] = dict(start)
    if model is not None:
        numbers = {name: value for name, value in start.items() if not isinstance(value, str)}
        grouped = by_declaration(model, numbers, lambda name: start_of(model, name))
        shown = {name: values if len(values) > 1 else values[0] for name, values in grouped.items()}
        shown |= {name: value for name, value in start.items() if isinstance(value, str)}
    path.write_text(json.dumps(shown, indent=2) + "\n", encoding="utf-8")
    return path


def write_ssv(start: Mapping[str, float | str], name: str, path: Path) -> Path:
    """Write the start values as a parameter set of System Structure and Parameterization 1.0."""
    root = parameter_set(start, name)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    return path


def parameter_set(start: Mapping[str, float | str], name: str) -> ElementTree.Element:
    """Return the start values as an XML element of that standard."""
    ElementTree.register_namespace("ssv", _SSV)
    root = ElementTree.Element(f"{{{_SSV}}}ParameterSet", {"version": "1.0", "name": plain(name)})
    parameters = ElementTree.SubElement(root, f"{{{_SSV}}}Parameters")
    for key, value in start.items():
        parameter = ElementTree.SubElement(parameters, f"{{{_SSV}}}Parameter", {"name": plain(key)})
        kind, text = ("String", plain(value)) if isinstance(value, str) else ("Real", repr(float(value)))
        ElementTree.SubElement(parameter, f"{{{_SSV}}}{kind}", {"value": text})
    return root


def write_mat(table: InputTable, start: Mapping[str, float | str], path: Path) -> Path:
    """Write inputs and start values for MATLAB, under valid MATLAB names.

    Each input is a matrix with the columns time and value, the format of From Workspace blocks and root
    inports; a repeated time is a step. ``start_values`` is a structure; ``names`` maps the MATLAB names to
    the model's own names.
    """
    from scipy.io import savemat

    short = matlab_names((*table.columns, *start))
    inputs = {short[n]: np.stack((table.times, column), axis=1) for n, column in table.columns.items()}
    structure = {short[n]: v if isinstance(v, str) else float(v) for n, v in start.items()}
    names = np.array([[matlab, plain(n)] for n, matlab in short.items()], dtype=object)
    savemat(
        path, {**inputs, "start_values": structure or np.empty((0, 0)), "names": names}, long_field_names=True
    )
    return path


def matlab_names(names: Iterable[str]) -> dict[str, str]:
    """Return the closest valid MATLAB name for each name; different names stay different.

    >>> matlab_names(["car.x[1]", "car.x(1)"])
    {'car.x[1]': 'car_x_1_', 'car.x(1)': 'car_x_1__2'}
    """
    found: dict[str, str] = {}
    taken = {"start_values", "names", *_MATLAB_KEYWORDS}
    for name in dict.fromkeys(names):
        base = re.sub(r"\W", "_", name, flags=re.ASCII)
        base = base if base[:1].isalpha() else f"x{base}"
        numbered = (f"_{i}" if i > 1 else "" for i in count(1))
        found[name] = next(
            new for end in numbered if (new := base[: _MATLAB_NAME_LENGTH - len(end)] + end) not in taken
        )
        taken.add(found[name])
    return found
