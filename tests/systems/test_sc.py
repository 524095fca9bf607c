from typing import Any

import numpy as np
import pytest

from tests.systems.driving import Array, Driver, evenly, golden, robustness

GOLDEN = golden("SC")
STOP = GOLDEN["stop_time"]
OUTPUTS = ("T", "Fcw", "Q", "pressure")


def steam(points: dict[str, Any], times: Array) -> Array:
    if "half_period" in points:
        phase = np.floor((times + points["lead"]) / points["half_period"] + 1e-9)
        return np.asarray(np.where(phase % 2 == 1, points["odd"], points["even"]))
    return evenly(points["values"], STOP).sample(times)


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_pressures(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    # The figures belong to inputs that change continuously: each is held for 2.5 ms at its value half-way.
    times = np.linspace(0, STOP, 14001) + 0.00125
    columns = fmu.run({"Fs": steam(run["Fs"], times)}, OUTPUTS, stop_time=STOP, samples=len(times))
    for output, start in GOLDEN["start"].items():
        assert columns[output][0] == pytest.approx(start, rel=1e-5)
    for time, expected in zip(GOLDEN["times"], run.get("pressure", []), strict="pressure" in run):
        assert columns["pressure"][round(time * 400)] == pytest.approx(expected, abs=GOLDEN["tolerance"])
    if "pressure_at_end" in run:
        assert columns["pressure"][-1] == pytest.approx(run["pressure_at_end"], abs=GOLDEN["tolerance"])
    for row in run["outputs"]:
        for output in ("T", "Fcw", "Q"):
            assert columns[output][round(row["time"] * 400)] == pytest.approx(row[output], rel=2e-6)
    measured = robustness("SC", "SC", columns, stop_time=STOP)
    assert measured == pytest.approx(run["robustness"], abs=2e-5)
