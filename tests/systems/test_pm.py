import numpy as np
import pytest

from falsifier.core.signals import Signal
from tests.systems.driving import Array, Driver, golden, robustness

GOLDEN = golden("PM")
STOP = GOLDEN["stop_time"]
TIMES = np.linspace(0, STOP, 10001)


def count(fmu: Driver, rates: Array) -> Array:
    return fmu.run({"LRL_input": rates}, ("PACE_COUNT",), stop_time=STOP, samples=len(rates))["PACE_COUNT"]


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_paces(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    points = run["LRL_input"]
    signal = Signal.evenly(points["values"], stop_time=STOP, interpolation=points["interpolation"])
    counted = count(fmu, signal.sample(TIMES))
    paces = TIMES[1:][np.diff(counted) > 0]
    # A pace that a step of the input sets off shows one row later: outputs are read before inputs are set.
    late = 1e-3 if name == "alternating" else 1e-9
    assert paces[: len(run["first"])] == pytest.approx(run["first"], abs=late)
    assert paces[-1] == pytest.approx(run["last"], abs=1e-9)
    assert counted[-1] == run["count"]
    if "count_each_second" in run:
        assert counted[1000::1000].tolist() == run["count_each_second"]
    assert robustness("PM", "PM", {"PACE_COUNT": counted}, stop_time=STOP) == pytest.approx(run["robustness"])


@pytest.mark.parametrize(("rate", "expected"), GOLDEN["counts"].items())
def test_golden_counts(fmu: Driver, rate: str, expected: int) -> None:
    assert count(fmu, np.full(len(TIMES), float(rate)))[-1] == expected


def test_periods(fmu: Driver) -> None:
    found = fmu.run({"LRL_input": np.full(11, 70.9)}, ("LRL", "Period"), stop_time=0.01, samples=11)
    assert (found["LRL"][-1], found["Period"][-1]) == (70, 857)
