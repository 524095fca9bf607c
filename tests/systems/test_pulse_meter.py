import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness

GOLDEN = golden("PulseMeter")
STOP, PERIOD = GOLDEN["stop_time"], 0.05
OUTPUTS = ("counted", "missed", "asleep")


def missed_pulses(contact: Array, *, period: float = PERIOD) -> int:
    """Count the pulses that the meter loses.

    Args:
        contact: state of the contact at every tick, 0 or 1.
        period: sample time in s.
    """
    closed = np.flatnonzero(np.concatenate([[False], contact > 0.5]))  # tick 0 is number 1 here
    begins = [int(k) for k in closed if k - 1 not in closed]
    missed, deaf_until = 0, 0
    for k in begins:
        if k < deaf_until:
            missed += 1
            continue
        last = max((int(j) for j in closed if j < k), default=0)
        slept = (k - 1 - last) * period > 6 - period / 2
        deaf_until = k + 1 + round((1.2 if slept else 0.1) / period)
    return missed


def contacts(pieces: list[int]) -> Array:
    """Return the contact at every tick of a run, held over equal pieces."""
    per_piece = round(STOP / PERIOD / len(pieces))
    return np.append(np.repeat(np.asarray(pieces, float), per_piece), float(pieces[-1]))


def drive(fmu: Driver, contact: Array) -> dict[str, Array]:
    rows = fmu.run({"contact": contact}, OUTPUTS, stop_time=STOP, samples=len(contact))
    return dict(zip(OUTPUTS, rows.T, strict=True))


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_counts(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, contacts(run["contact"]))
    assert found["counted"][-1] == run["counted"]
    assert found["missed"][-1] == run["missed"]
    if "asleep_from" in run:
        assert np.flatnonzero(found["asleep"])[0] * PERIOD == pytest.approx(run["asleep_from"])
    if "missed_at" in run:  # outputs are read before the input is set: one row later
        assert np.flatnonzero(found["missed"])[0] * PERIOD == pytest.approx(run["missed_at"] + PERIOD)
    assert robustness("PulseMeter", "PulseMeter", found, stop_time=STOP) == run["robustness"]


def test_independent_counts(fmu: Driver) -> None:
    rng = np.random.default_rng(37)
    total = 0
    for run in range(200):
        if run % 2:
            pieces = [0] * rng.integers(10, 14) + rng.integers(0, 2, 14).tolist()
            contact = contacts(pieces[:24])
        else:  # pulses at any tick, few and far apart
            contact = (rng.random(241) < 0.02).astype(float)
        contact[-1] = contact[-2]  # the run ends before the last value acts
        found = drive(fmu, contact)
        begins = np.count_nonzero(np.diff(contact, prepend=0) > 0)
        expected = missed_pulses(contact)
        assert found["missed"][-1] == expected
        assert found["counted"][-1] == begins - expected
        total += expected
    assert total > 20
