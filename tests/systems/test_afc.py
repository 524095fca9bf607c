from collections.abc import Sequence

import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, held, robustness

GOLDEN = golden("AFC")
STOP = GOLDEN["stop_time"]
OUTPUTS = ("mu", "mode", "pressure", "fuel")
PIECE = 5.0


def drive(fmu: Driver, pedal: Sequence[float], engine: float, stop: float = STOP) -> dict[str, Array]:
    """Drive with equal pieces of the pedal at the controller's samples."""
    inputs = {"pedal": held(pedal, round(stop / 0.01 / len(pedal)))}
    inputs["engine"] = np.full(len(inputs["pedal"]), engine)
    found = fmu.run(inputs, OUTPUTS, stop_time=stop, samples=len(inputs["pedal"]))
    return {"pedal": inputs["pedal"], **found}


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_ratios(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, run["pedal"], run["engine"])
    at = [round(100 * t) for t in GOLDEN["times"]]
    assert found["mu"][at] == pytest.approx(run["mu"], abs=GOLDEN["tolerance"])
    assert np.all(found["mu"][:100] == 0)
    assert np.all(found["mode"][:1000] == 1)
    assert np.all(found["mode"][1000:] == run["mode_after_10_s"])
    for row in run["state"]:
        k = round(100 * row["time"])
        assert found["pressure"][k] == pytest.approx(row["pressure"], abs=2e-5)
        assert found["fuel"][k] == pytest.approx(row["fuel"], abs=4e-5)
    measured = {name: robustness(name, "AFC", found, stop_time=STOP) for name in run["robustness"]}
    assert measured == pytest.approx(run["robustness"], abs=1e-4)


@pytest.mark.parametrize("name", [n for n, run in GOLDEN["runs"].items() if "then" in run])
def test_golden_answers_to_steps(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, [*run["pedal"], run["then"]], run["engine"], STOP + PIECE)
    expected = run["robustness_until_55_s"]
    measured = {name: robustness(name, "AFC", found, stop_time=STOP + PIECE) for name in expected}
    assert measured == pytest.approx(expected, abs=3e-5)


def test_a_dead_sensor_opens_the_loop(fmu: Driver) -> None:
    inputs = {"pedal": np.full(2001, 30.0), "engine": np.full(2001, 1000.0)}
    mode = fmu.run(inputs, ("mode",), stop_time=20.0, samples=2001, parameters={"faultTime": 15.0})["mode"]
    assert mode[1000:1500].max() == 0
    assert mode[1500:].min() == 1
