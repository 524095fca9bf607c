import csv
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.io import loadmat

from falsifier.core.candidate import Candidate
from falsifier.core.model import Kind, ModelInfo, Variable
from falsifier.core.ranges import Freedom
from falsifier.core.signals import Signal
from falsifier.counterexamples.export.tables import (
    InputTable,
    input_table,
    parameter_set,
    write_csv,
    write_mat,
    write_ssv,
)
from falsifier.evaluation.input_file import read_inputs
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem
from tests.fmu.fixtures import ME, path as fmu_path


def test_the_ssv_is_valid_and_reads_back(tmp_path: Path) -> None:
    fmpy_ssd = pytest.importorskip("fmpy.ssp.ssd")
    path = write_ssv({"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}, "A & B", tmp_path / "s.ssv", ModelInfo("m"))
    read = fmpy_ssd.read_ssv(str(path))  # validates against the schema of SSP 1.0
    assert read.name == "A & B"
    assert {p.name: float(p.value) for p in read.parameters} == {"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}


def test_parameter_sets_have_the_types_of_the_model(tmp_path: Path) -> None:
    kinds: dict[str, Kind] = {"b": "boolean", "n": "integer", "m": "enumeration", "x": "real", "s": "string"}
    literals = {"Off": 1, "Eco mode": 7}
    info = ModelInfo(
        "m", variables=tuple(Variable(n, k, literals=literals if n == "m" else {}) for n, k in kinds.items())
    )
    start: dict[str, float | str] = {"b": 1.0, "n": 3.0, "m": 7.0, "x": 2.0, "s": "a"}
    root = ElementTree.parse(write_ssv(start, "m", tmp_path / "s.ssv", info)).getroot()
    found = {p.get("name"): (p[0].tag.rpartition("}")[2], p[0].get("value")) for p in root[0]}
    assert found == {
        "b": ("Boolean", "true"),
        "n": ("Integer", "3"),
        "m": ("Enumeration", "Eco mode"),
        "x": ("Real", "2.0"),
        "s": ("String", "a"),
    }
    (number,) = parameter_set({"m": 7.0}, "m", info, named=False)[0][0]
    assert (number.tag.rpartition("}")[2], number.get("value")) == ("Integer", "7")


def test_the_mat_file_holds_a_matrix_of_inputs_and_the_models_own_names(tmp_path: Path) -> None:
    problem = lag_problem(free=Freedom(10, 0.1), inputs=2)
    steps = {"u": Signal((0.0, 5.0), (0.0, 1.0), "constant"), "v": Signal((0.0,), (0.5,))}
    start: dict[str, float | str] = {"a.b[2]": 3.0, "file": "größe"}
    content = loadmat(write_mat(input_table(problem, Candidate(steps)), start, tmp_path / "i.mat"))
    assert content["inputs"].tolist() == [[0.0, 0.0, 0.5], [5.0, 0.0, 0.5], [5.0, 1.0, 0.5], [10.0, 1.0, 0.5]]
    cells = {name: [cell.item() for cell in content[name].ravel()] for name in content if "_n" in name}
    assert cells == {"input_names": ["u", "v"], "start_names": ["a.b[2]", "file"]}
    assert [cell.item() for cell in content["start_values"].ravel()] == [3.0, "größe"]
    write_mat(InputTable(np.array([0.0, 1.0]), {}), {}, tmp_path / "empty.mat")
    assert loadmat(tmp_path / "empty.mat")["inputs"].tolist() == [[0.0], [1.0]]


def test_the_csv_reads_back_exactly(tmp_path: Path) -> None:
    table = InputTable(
        np.array([0.0, 0.1 + 0.2, 1.0]), {"u": np.array([1 / 3, -0.0, 1e-300]), "a,b": np.ones(3)}
    )
    path = write_csv(table, tmp_path / "i.csv", lag_problem().model)
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["time", "u", "a,b"]
    assert [[float(cell) for cell in row] for row in rows] == [
        [0.0, 1 / 3, 1.0],
        [0.1 + 0.2, 0.0, 1.0],
        [1.0, 1e-300, 1.0],
    ]


def test_an_input_named_time_does_not_replace_the_times(tmp_path: Path) -> None:
    table = InputTable(np.array([0.0, 10.0]), {"time": np.array([0.5, 0.5])})
    path = write_csv(table, tmp_path / "i.csv", lag_problem().model)
    assert path.read_text() == '"time","time"\n0.0,0.5\n10.0,0.5\n'


@pytest.mark.parametrize("interval", [0.1, 1e6 / 3])
def test_steps_of_a_linear_input_stay_steps_for_a_solver(interval: float, tmp_path: Path) -> None:
    """At each communication point the ramp of a step begins in the step before."""
    lag, inputs = fmu_path("Lag_2"), {"u": (-1, 1)}
    problem = Problem.from_fmu(
        lag, "G (y <= 9)", inputs=inputs, interface=ME, stop_time=100 * interval, output_interval=interval
    )
    for step in range(1, 100):
        time = problem.experiment.times[step]
        (file := tmp_path / "u.csv").write_text(f"t,u\n0,0\n{time},1\n{time},-1\n{101 * interval},0\n")
        table = input_table(problem, Candidate(read_inputs(file, problem.info).signals))
        assert np.interp(time - 1e-6, table.times, table.columns["u"]) == pytest.approx(1.0, rel=1e-3)


def test_steps_stand_where_the_simulation_set_them() -> None:
    problem = load_problem("AT1")
    candidate = problem.space.admit(
        Candidate(
            {"throttle": Signal((0.0, 1.23), (100.0, 35.0), "constant"), "brake": Signal((0.0,), (0.0,))}
        )
    )
    table = input_table(problem, candidate)
    # Sampled every 0.05 s and held: the value of 1.23 s arrives at 1.25 s.
    assert table.times.tolist() == pytest.approx([0.0, 1.25, 1.25, 50.0])
    assert table.columns["throttle"].tolist() == [100.0, 100.0, 35.0, 35.0]
    assert table.columns["brake"].tolist() == [0.0] * 4
