from math import pi

import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness

GOLDEN = golden("F16")
STOP = GOLDEN["stop_time"]
SAMPLES = 451
STAND_BY, ROLL, PULL = range(3)
STATE = ("vt", "alpha", "beta", "phi", "theta", "psi", "p", "q", "r", "altitude")


def fly(fmu: Driver, roll: float, pitch: float, yaw: float) -> dict[str, Array]:
    attitude = {"roll": roll, "pitch": pitch, "yaw": yaw}
    return fmu.run({}, (*STATE, "mode"), stop_time=STOP, samples=SAMPLES, parameters=attitude)


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_flights(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    flight = fly(fmu, run["roll"] * pi, run["pitch"] * pi, run["yaw"] * pi)
    altitude = flight["altitude"]
    at = [round(30 * t) for t in GOLDEN["times"]]
    assert altitude[at] == pytest.approx(run["altitude"], abs=GOLDEN["altitude_tolerance"])
    measured = robustness("F16", "F16", {"altitude": altitude}, stop_time=STOP)
    assert measured == pytest.approx(run["minimum"], abs=GOLDEN["minimum_tolerance"])
    assert altitude.argmin() / 30 == pytest.approx(run["minimum_at"], abs=1e-3)
    switches = np.flatnonzero(np.diff(flight["mode"])) + 1
    assert flight["mode"][[0, *switches]].tolist() == [ROLL, PULL, STAND_BY]
    assert switches / 30 == pytest.approx([run["pull_at"], run["stand_by_at"]], abs=1e-3)
    assert np.rad2deg(flight["alpha"].max()) == pytest.approx(run["max_alpha_deg"], abs=1e-2)


def test_golden_states(fmu: Driver) -> None:
    run, state = GOLDEN["runs"]["B"], GOLDEN["state"]
    flight = fly(fmu, run["roll"] * pi, run["pitch"] * pi, run["yaw"] * pi)
    for name, at_1, at_4 in zip(state["names"], state["at_1"], state["at_4"], strict=True):
        assert flight[name][30] == pytest.approx(at_1, rel=1e-4, abs=1e-4), name
        assert flight[name][120] == pytest.approx(at_4, rel=1e-4, abs=2e-4), name


def test_golden_minima_over_the_box(fmu: Driver) -> None:
    grid = GOLDEN["grid"]
    minima = [
        [fly(fmu, roll * pi, pitch * pi, -0.25 * pi)["altitude"].min() for pitch in grid["pitch"]]
        for roll in grid["roll"]
    ]
    assert np.array(minima) == pytest.approx(np.array(grid["minimum"]), abs=grid["tolerance"])
