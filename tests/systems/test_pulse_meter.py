import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness

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
