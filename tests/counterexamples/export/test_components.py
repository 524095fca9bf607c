import csv
import json
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo
from falsifier.core.signals import Signal
from falsifier.counterexamples.export.components import FOLDER, write_components, write_package
from falsifier.counterexamples.export.tables import write_ssv
from falsifier.evaluation.evaluate import simulate
from falsifier.evaluation.input_file import read_inputs
from falsifier.fmu import Component, Connection, Coupling, System, read_package
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.problem.source import ProblemSource
from tests.fmu.fixtures import altered, path
from tests.fmu.packages import FEEDBACK, PI, PLANT, structure, system, values, write
from tests.fmu.small_systems import LINEAR, LOOP, component, run, solved, system as built

DRIVE = Candidate({"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}, {"plant.T": 1.5, "pi.k": 1.0})

FOLLOWED = {"plant.u": Connection("pi.y", extrapolation="linear"), "pi.measured": "plant.y"}


def problem_of(model: System) -> Problem:
    return Problem.from_fmu(
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
        (solved("Lag_2"), "Gain_3", FOLLOWED, Coupling("jacobi")),
        (solved("Lag_2"), component("Gain_2", 0.2), FOLLOWED, Coupling()),
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
    whole = problem_of(built({"plant": plant, "pi": pi}, links, coupling))
    write_components(whole, DRIVE, tmp_path)
    for name in ("plant", "pi"):
        folder = tmp_path / "components" / name
        alone = load_source(ProblemSource(target=str(folder / f"{name}.toml")), searches=False)
        inputs = read_inputs(folder / "input.csv", alone.info)
        again = simulate(alone, inputs.signals).trajectory
        in_system = recorded(folder / "outputs.csv")
        assert again is not None and again.times.tolist() == pytest.approx(in_system["time"])
        # At time 0, the controller alone has its input of the first step; see docs/systems.md.
        np.testing.assert_allclose(again["y"][1:], in_system["y"][1:], atol=1e-6)
        alone.model.close()
    assert json.loads((tmp_path / "components" / "plant" / "start_values.json").read_text()) == {"T": 1.5}


def test_names_of_any_characters_can_be_written_to_the_spec(tmp_path: Path) -> None:
    odd = {"u": 'wheel "1" \U0001f600', "y": "height.always", "T": "time constant"}

    def in_odd_names(content: bytes) -> bytes:
        for old, new in odd.items():
            content = content.replace(f'name="{old}" value'.encode(), f"name={quoteattr(new)} value".encode())
        return content

    renamed = altered(path("Plant_2"), tmp_path / "Plant.fmu", in_odd_names, ending="modelDescription.xml")
    links = {f"plant.{odd['u']}": "pi.y", "pi.measured": f"plant.{odd['y']}"}
    whole = Problem.from_fmu(
        System({"plant": renamed, "pi": path("Gain_2")}, links),
        "G (plant.height.always <= 10)",
        inputs={"pi.r": (0.0, 2.0)},
        stop_time=1.0,
        output_interval=0.1,
    )
    write_components(whole, Candidate({"pi.r": Signal((0.0,), (1.0,))}, {f"plant.{odd['T']}": 1.5}), tmp_path)
    spec = ProblemSource(target=str(tmp_path / FOLDER / "plant" / "plant.toml"))
    alone = load_source(spec, searches=False)
    assert [v.name for v in alone.info.inputs] == [odd["u"]] and odd["T"] in alone.parameters
    assert alone.requirement.formula.signals == (odd["y"],)


def test_what_is_omitted_is_not_recorded_for_a_component_alone_either(tmp_path: Path) -> None:
    whole = Problem.from_fmu(
        System({"plant": path("Plant_2"), "echo": path("Echo_2")}, {"echo.in_Real": "plant.y"}),
        "G (plant.y <= 10)",
        inputs={"plant.u": (0.0, 2.0)},
        stop_time=1.0,
        output_interval=0.1,
        omit=["echo.out_Real"],
    )
    write_components(whole, Candidate({"plant.u": Signal((0.0,), (1.0,))}), tmp_path)
    assert "out_Real" not in recorded(tmp_path / FOLDER / "echo" / "outputs.csv")
    spec = ProblemSource(target=str(tmp_path / FOLDER / "echo" / "echo.toml"))
    assert "out_Real" not in load_source(spec, searches=False).experiment.outputs


def again(model: System, tmp_path: Path, resources: dict[str, Path] | None = None) -> System:
    return read_package(write_package(model, 3.0, resources or {}, tmp_path / "again.ssp"))


def test_trajectories_conversions_and_the_stop_time_stay(tmp_path: Path) -> None:
    links = {**LOOP, "pi.measured": Connection("plant.y", factor=0.5, offset=0.1)}
    model = built({"plant": "Plant_2", "pi": "Gain_3"}, links)
    csv = tmp_path / "input.csv"
    csv.write_text("time\n")
    ssv = write_ssv({"plant.T": 3.0, "plant.x": 0.2}, "R", tmp_path / "start_values.ssv", model.info)
    found = again(model, tmp_path, {csv.name: csv, ssv.name: ssv})
    assert found.info.stop_time == 3.0 and found.info.connections == model.info.connections
    given = {"plant.T": 3.0, "plant.x": 0.2}
    np.testing.assert_array_equal(
        run(found, "plant.x")["plant.x"], run(model, "plant.x", parameters=given)["plant.x"]
    )
    with zipfile.ZipFile(tmp_path / "again.ssp") as package:
        assert {"resources/input.csv", "resources/start_values.ssv"} <= set(package.namelist())


def test_inputs_outputs_and_values_of_the_whole_stay(tmp_path: Path) -> None:
    ports = """<ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="way" kind="output"><ssc:Real unit="m"/></ssd:Connector>
      </ssd:Connectors><ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"""
    ports += f"{values('plant.T Real 4', 'r Real 0.5')}</ssd:ParameterValues></ssd:ParameterBinding>"
    wire = '<ssd:Connection startConnector="r" endElement="pi" endConnector="r"/>'
    wire += '<ssd:Connection startElement="plant" startConnector="y" endConnector="way"/>'
    ssd = structure(system(PLANT + PI, FEEDBACK + wire, before=f"{ports}</ssd:ParameterBindings>"))
    model = read_package(write(tmp_path / "a.ssp", ssd, "Plant_2", "Gain_2"))
    found = again(model, tmp_path)
    assert [v.name for v in found.info.inputs] == ["r"] and found.frame.values == model.frame.values
    np.testing.assert_array_equal(run(found, "plant.x")["plant.x"], run(model, "plant.x")["plant.x"])
    assert found.info["way"] == model.info["way"], "requirements may name it"


def test_the_package_follows_the_schema_of_the_standard(tmp_path: Path) -> None:
    from fmpy.ssp.ssd import read_ssd

    links = {**LOOP, "pi.measured": Connection("plant.y", factor=0.5)}
    ssv = write_ssv({"plant.T": 3.0}, "R", tmp_path / "start_values.ssv", ModelInfo("m"))
    model = built({"plant": "Plant_2", "pi": "Gain_3", "echo": "Echo_2"}, links)  # with values of all types
    file = write_package(model, 3.0, {ssv.name: ssv}, tmp_path / "a.ssp")
    assert [e.name for e in read_ssd(str(file), validate=True).system.elements] == ["plant", "pi", "echo"]
    with zipfile.ZipFile(file) as package:  # without a unit, which it would define, it is that of the FMU
        assert b" unit=" not in package.read("SystemStructure.ssd")
