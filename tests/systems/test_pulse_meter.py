import numpy as np
import pytest

from tests.systems.driving import Driver, golden, held

GOLDEN = golden("PulseMeter")
STOP, PERIOD = GOLDEN["stop_time"], 0.05
OUTPUTS = ("counted", "missed", "asleep")


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_counts(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    contact = held(run["contact"], round(STOP / PERIOD / len(run["contact"])))
    found = fmu.run({"contact": contact}, OUTPUTS, stop_time=STOP, samples=len(contact))
    assert found["counted"][-1] == run["counted"]
    assert found["missed"][-1] == run["missed"]
    if "asleep_from" in run:
        assert np.flatnonzero(found["asleep"])[0] * PERIOD == pytest.approx(run["asleep_from"])
    if "missed_at" in run:  # outputs are read before the input is set: one row later
        assert np.flatnonzero(found["missed"])[0] * PERIOD == pytest.approx(run["missed_at"] + PERIOD)
