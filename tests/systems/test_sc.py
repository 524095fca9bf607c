from typing import Any

import numpy as np
import pytest

from tests.systems.driving import Array, Driver, evenly, golden, robustness
from tests.systems.independent import sc

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
    rows = fmu.run({"Fs": steam(run["Fs"], times)}, OUTPUTS, stop_time=STOP, samples=len(times))
    columns = dict(zip(OUTPUTS, rows.T, strict=True))
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


def test_independent_condenser(fmu: Driver) -> None:
    rng = np.random.default_rng(33)
    times = np.linspace(0, STOP, 3501)
    flows = np.column_stack([evenly(list(v), STOP).sample(times) for v in rng.uniform(3.99, 4.01, (24, 18))])
    flows[:, ::4] = np.where(flows[:, ::4] > 4, 4.4, 3.6)  # far from the benchmark's range
    expected = sc.outputs(flows, 0.01)
    for run, flow in enumerate(flows.T):
        rows = fmu.run({"Fs": flow}, OUTPUTS, stop_time=STOP, samples=len(times))
        for output, column in zip(OUTPUTS, rows.T, strict=True):
            if output == "Q":
                column, reference = column[1:], expected[output][1:, run]
            else:
                reference = expected[output][:, run]
            assert np.abs(column - reference).max() < 1e-5 * np.abs(reference).max(), output
