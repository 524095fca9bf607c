import numpy as np
import pytest

from tests.systems.driving import Array, Driver, evenly, golden, robustness

GOLDEN = golden("CC")
POSITIONS = ("y1", "y2", "y3", "y4", "y5")
MODES = ("car2.mode", "car3.mode", "car4.mode", "car5.mode")
STOP = GOLDEN["stop_time"]


def drive(fmu: Driver, throttle: Array, brake: Array) -> dict[str, Array]:
    inputs = {"throttle": throttle, "brake": brake}
    return fmu.run(inputs, POSITIONS + MODES, stop_time=STOP, samples=len(throttle))


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_positions(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    # The figures belong to inputs that change continuously: each is held for 1 ms at its value half-way.
    times = np.linspace(0, STOP, 100001) + 0.0005
    found = drive(fmu, *(evenly(run[i], STOP).sample(times) for i in ("throttle", "brake")))
    for (time, *expected), letters in zip(run["rows"], run["modes"], strict=True):
        k = round(time * 1000)
        assert [found[y][k] for y in POSITIONS] == pytest.approx(expected, abs=1e-3), f"t = {time}"
        assert "".join("?KCB"[int(found[m][k])] for m in MODES) == letters, f"t = {time}"
    for requirement, expected in run["robustness"].items():
        assert robustness(requirement, "CC", found, stop_time=STOP) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("requirement", GOLDEN["falsifying"])
def test_golden_violations(fmu: Driver, requirement: str) -> None:
    run = GOLDEN["falsifying"][requirement]
    times = np.linspace(0, STOP, 10001) + 0.005
    found = drive(fmu, *(evenly(run[i], STOP).sample(times) for i in ("throttle", "brake")))
    measured = robustness(requirement, "CC", found, stop_time=STOP)
    assert measured < 0
    assert measured == pytest.approx(run["robustness"], abs=2e-3)


def test_many_mode_changes_are_all_taken(fmu: Driver) -> None:
    run = GOLDEN["runs"]["Q"]
    found = drive(fmu, *(np.full(100001, run[i][0]) for i in ("throttle", "brake")))
    changes = [np.count_nonzero(np.diff(found[mode])) for mode in MODES]
    assert changes == pytest.approx(run["mode_changes"], abs=1)
