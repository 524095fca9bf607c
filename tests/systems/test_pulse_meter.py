import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness
from tests.systems.independent.faults import missed_pulses

GOLDEN = golden("PulseMeter")
STOP, PERIOD = GOLDEN["stop_time"], 0.05
OUTPUTS = ("counted", "missed", "asleep")


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
