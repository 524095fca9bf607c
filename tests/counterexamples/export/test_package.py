"""A system that is written as an SSP package and read again is the same system."""

import zipfile
from pathlib import Path

import numpy as np

from falsifier.counterexamples.export.package import write_package
from falsifier.counterexamples.export.tables import write_ssv
from falsifier.fmu import Connection, System, read_package
from tests.fmu.packages import FEEDBACK, PI, PLANT, structure, system, values, write
from tests.fmu.small_systems import LOOP, run, solved
from tests.fmu.small_systems import system as built


def again(model: System, tmp_path: Path, resources: dict[str, Path] | None = None) -> System:
    found = read_package(write_package(model, 3.0, resources or {}, tmp_path / "again.ssp"))
    return found


def test_trajectories_conversions_and_the_stop_time_stay(tmp_path: Path) -> None:
    links = {**LOOP, "pi.measured": Connection("plant.y", factor=0.5, offset=0.1)}
    model = built({"plant": "Plant_2", "pi": "Gain_3"}, links)
    csv = tmp_path / "input.csv"
    csv.write_text("time\n")
    ssv = write_ssv({"plant.T": 3.0, "plant.x": 0.2}, "R", tmp_path / "start_values.ssv")
    found = again(model, tmp_path, {csv.name: csv, ssv.name: ssv})
    assert found.info.stop_time == 3.0 and found.info.connections == model.info.connections
    given = {"plant.T": 3.0, "plant.x": 0.2}
    np.testing.assert_array_equal(
        run(found, "plant.x")["plant.x"], run(model, "plant.x", parameters=given)["plant.x"]
    )
    with zipfile.ZipFile(tmp_path / "again.ssp") as package:
        assert {"resources/input.csv", "resources/start_values.ssv"} <= set(package.namelist())


def test_inputs_and_values_of_the_whole_stay(tmp_path: Path) -> None:
    ports = """<ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector>
      </ssd:Connectors><ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"""
    ports += f"{values('plant.T Real 4', 'r Real 0.5')}</ssd:ParameterValues></ssd:ParameterBinding>"
    wire = '<ssd:Connection startConnector="r" endElement="pi" endConnector="r"/>'
    ssd = structure(system(PLANT + PI, FEEDBACK + wire, before=f"{ports}</ssd:ParameterBindings>"))
    model = read_package(write(tmp_path / "a.ssp", ssd, "Plant_2", "Gain_2"))
    found = again(model, tmp_path)
    assert [v.name for v in found.info.inputs] == ["r"] and found.frame.values == model.frame.values
    np.testing.assert_array_equal(run(found, "plant.x")["plant.x"], run(model, "plant.x")["plant.x"])


def test_interfaces_stay(tmp_path: Path) -> None:
    model = built({"plant": solved("Lag_2"), "pi": "Gain_3"}, LOOP)
    found = again(model, tmp_path)
    assert [m.interface for m in found.network.members] == ["model-exchange", "co-simulation"]
    np.testing.assert_array_equal(run(found, "plant.x")["plant.x"], run(model, "plant.x")["plant.x"])


def test_the_package_follows_the_schema_of_the_standard(tmp_path: Path) -> None:
    from fmpy.ssp.ssd import read_ssd

    links = {**LOOP, "pi.measured": Connection("plant.y", factor=0.5)}
    ssv = write_ssv({"plant.T": 3.0}, "R", tmp_path / "start_values.ssv")
    file = write_package(
        built({"plant": "Plant_2", "pi": "Gain_3"}, links), 3.0, {ssv.name: ssv}, tmp_path / "a.ssp"
    )
    found = read_ssd(str(file), validate=True)
    assert [e.name for e in found.system.elements] == ["plant", "pi"]
