import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness

GOLDEN = golden("ChargerHandshake")
STOP, PERIOD = GOLDEN["stop_time"], 0.1
OUTPUTS = ("phase", "locked", "closed", "voltage")


WAIT, LOCK, UNLOCK, PRECHARGE, CLOSE, OPEN, RESET = range(1, 8)
IDLE, LOCKED, PRECHARGING, READY, CHARGING = range(1, 6)
_NEXT = {(IDLE, LOCK): LOCKED, (LOCKED, PRECHARGE): PRECHARGING, (READY, CLOSE): CHARGING}
_LONGEST = {LOCKED: 25, PRECHARGING: 40, READY: 20}
_ABORTS = {
    LOCKED: {UNLOCK},
    PRECHARGING: {WAIT, LOCK, UNLOCK, CLOSE},
}


def charger(command: Array, *, period: float = PERIOD) -> Array:
    """Return phase, lock, contactors and voltage at every tick, shape (ticks, 4).

    Args:
        command: command of the car at every tick.
        period: sample time in s.
    """
    phase, since, locked, voltage = IDLE, 0, 0, 0.0
    rows = []
    for tick, asked in enumerate(command.astype(int)):
        too_late = tick - since > _LONGEST.get(phase, 10**9)
        if too_late or asked in {OPEN, RESET} | _ABORTS.get(phase, set()):
            following, locked = IDLE, 0
        elif phase == PRECHARGING and voltage >= 380:
            following = READY
        else:
            following = _NEXT.get((phase, asked), phase)
        if following == LOCKED != phase:
            locked = 1
        if asked == UNLOCK and following != CHARGING:
            locked = 0
        if following != phase:
            phase, since = following, tick
        rows.append((phase, locked, int(phase == CHARGING), voltage))
        goal, lag = (400.0, 0.8) if phase >= PRECHARGING else (0.0, 0.5)
        voltage = goal + (voltage - goal) * float(np.exp(-period / lag))
    return np.array(rows, dtype=np.float64)


def commands(pieces: list[int]) -> Array:
    """Return the command at every tick of a run, held over pieces of 1 s."""
    return np.append(np.repeat(np.asarray(pieces, float), 10), float(pieces[-1]))


def drive(fmu: Driver, command: Array) -> dict[str, Array]:
    rows = fmu.run({"command": command}, OUTPUTS, stop_time=STOP, samples=len(command))
    return dict(zip(OUTPUTS, rows.T, strict=True))


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_phases(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, commands(run["command"]))
    ends = np.arange(9, 160, 10)
    for output in ("phase", "locked", "closed"):
        assert found[output][ends].tolist() == run[output], output
    for time, expected in run["voltage"].items():
        assert found["voltage"][10 * int(time)] == pytest.approx(expected, abs=0.05)
    assert np.flatnonzero(found["phase"] == READY)[0] * PERIOD == pytest.approx(run["ready_at"])
    if "violated_at" in run:  # outputs are read before the input is set: one row later
        wrong = (found["closed"] > 0) & (found["locked"] == 0)
        assert np.flatnonzero(wrong)[0] * PERIOD == pytest.approx(run["violated_at"] + PERIOD)
    measured = robustness("ChargerHandshake", "ChargerHandshake", found, stop_time=STOP)
    assert measured == run["robustness"]


def test_independent_phases(fmu: Driver) -> None:
    rng = np.random.default_rng(38)
    likely = [LOCK, PRECHARGE, PRECHARGE, PRECHARGE, UNLOCK, CLOSE]
    wrong = 0
    for _ in range(200):
        pieces = rng.integers(1, 8, 16)
        begin = rng.integers(0, 10)
        pieces[begin : begin + 6] = likely
        pieces[rng.integers(0, 16)] = rng.integers(1, 8)
        command = commands(pieces.tolist())
        found, expected = drive(fmu, command), charger(command)
        # When the command changes, outputs are read before the input is set.
        same = np.diff(command, prepend=command[0]) == 0
        for k, output in enumerate(OUTPUTS):
            assert found[output][same] == pytest.approx(expected[same, k], abs=0.1), output
        wrong += bool(np.any((expected[:, 2] > 0) & (expected[:, 1] == 0)))
    assert wrong > 50
