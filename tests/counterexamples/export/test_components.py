"""A component alone, with what it saw in the system, gives the same outputs."""

import csv
import json
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.export.components import FOLDER, write_components
from falsifier.evaluation.evaluate import simulate
from falsifier.evaluation.input_file import read_inputs
from falsifier.fmu import Component, Connection, Coupling, System
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from tests.fmu.fixtures import path
from tests.fmu.small_systems import LOOP, component, solved, system

DRIVE = Candidate({"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}, {"plant.T": 1.5, "pi.k": 1.0})
LINEAR = {"plant.u": Connection("pi.y"), "pi.measured": Connection("plant.y", extrapolation="linear")}


def problem_of(model: System) -> Problem:
    return Problem.from_system(
        model,
        "G (plant.y <= 10)",
        inputs={"pi.r": (0.0, 2.0)},
        parameters={"plant.T": (1.0, 2.0)},
        stop_time=1.0,
        output_interval=0.1,
    )


def recorded(file: Path) -> dict[str, list[float]]:
    with file.open() as lines:
        rows = list(csv.reader(lines))
    return {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}


@pytest.mark.parametrize(
    ("plant", "pi", "links", "coupling"),
    [
        ("Plant_2", "Gain_2", LOOP, Coupling()),
        ("Plant_3", "Gain_3", LINEAR, Coupling("jacobi")),
        ("Plant_2", component("Gain_2", 0.2), LINEAR, Coupling()),
        (solved("Lag_2"), "Gain_3", LINEAR, Coupling()),
        ("Lead_2", component("Gain_2", 0.2), LOOP, Coupling(loops="delay")),
    ],
)
def test_each_component_alone_does_what_it_did_in_the_system(
    plant: str | Component,
    pi: str | Component,
    links: dict[str, str | Connection],
    coupling: Coupling,
    tmp_path: Path,
) -> None:
    whole = problem_of(system({"plant": plant, "pi": pi}, links, coupling))
    write_components(whole, DRIVE, tmp_path)
    for name in ("plant", "pi"):
        folder = tmp_path / "components" / name
        alone = load_problem(str(folder / f"{name}.toml"))
        inputs = read_inputs(folder / "input.csv", alone.info)
        again = simulate(alone, inputs.signals).trajectory
        in_system = recorded(folder / "outputs.csv")
        assert again is not None and again.times.tolist() == pytest.approx(in_system["time"])
        # At time 0, the controller alone has its input of the first step; see docs/systems.md.
        np.testing.assert_allclose(again["y"][1:], in_system["y"][1:], atol=1e-6)
        alone.model.close()
    assert json.loads((tmp_path / "components" / "plant" / "start_values.json").read_text()) == {"T": 1.5}


def test_a_constant_input_at_its_upper_limit_gets_a_range_that_the_fmu_allows(tmp_path: Path) -> None:
    whole = problem_of(system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP))
    write_components(whole, Candidate({"pi.r": Signal((0.0,), (2.0,))}, {"plant.T": 1.5}), tmp_path)
    alone = load_problem(str(tmp_path / "components" / "pi" / "pi.toml"))
    assert alone.info["r"].high == 2.0
    assert (1.0, 2.0) in [(r.low, r.high) for r in alone.space.inputs if r.name == "r"]
    alone.model.close()


def test_names_of_any_characters_can_be_written_to_the_spec(tmp_path: Path) -> None:
    odd = {"u": 'wheel "1" \U0001f600', "y": "height.always", "T": "time constant"}
    renamed = tmp_path / "Plant.fmu"
    with zipfile.ZipFile(path("Plant_2")) as source, zipfile.ZipFile(renamed, "w") as target:
        for entry in source.infolist():
            data = source.read(entry)
            if entry.filename == "modelDescription.xml":
                for old, new in odd.items():
                    written = f"name={quoteattr(new)} value"
                    data = data.replace(f'name="{old}" value'.encode(), written.encode())
            target.writestr(entry.filename, data)
    links = {f"plant.{odd['u']}": "pi.y", "pi.measured": f"plant.{odd['y']}"}
    whole = Problem.from_system(
        System({"plant": renamed, "pi": path("Gain_2")}, links),
        "G (plant.height.always <= 10)",
        inputs={"pi.r": (0.0, 2.0)},
        stop_time=1.0,
        output_interval=0.1,
    )
    write_components(whole, Candidate({"pi.r": Signal((0.0,), (1.0,))}, {}), tmp_path)
    alone = load_problem(str(tmp_path / FOLDER / "plant" / "plant.toml"))
    assert [r.name for r in alone.space.inputs] == [odd["u"]]
    assert alone.requirement.formula.signals == (odd["y"],)
