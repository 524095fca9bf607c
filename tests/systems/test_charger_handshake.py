import numpy as np
import pytest

from tests.systems.driving import Driver, golden, held

GOLDEN = golden("ChargerHandshake")
STOP, PERIOD, READY = GOLDEN["stop_time"], 0.1, 4
OUTPUTS = ("phase", "locked", "closed", "voltage")


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_phases(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    command = held(run["command"], 10)
    found = fmu.run({"command": command}, OUTPUTS, stop_time=STOP, samples=len(command))
    ends = np.arange(9, 160, 10)
    for output in ("phase", "locked", "closed"):
        assert found[output][ends].tolist() == run[output], output
    for time, expected in run["voltage"].items():
        assert found["voltage"][10 * int(time)] == pytest.approx(expected, abs=0.05)
    assert np.flatnonzero(found["phase"] == READY)[0] * PERIOD == pytest.approx(run["ready_at"])
    if "violated_at" in run:  # outputs are read before the input is set: one row later
        wrong = (found["closed"] > 0) & (found["locked"] == 0)
        assert np.flatnonzero(wrong)[0] * PERIOD == pytest.approx(run["violated_at"] + PERIOD)
