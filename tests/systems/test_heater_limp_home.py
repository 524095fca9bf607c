import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, robustness
from tests.systems.independent.faults import heater

GOLDEN = golden("HeaterLimpHome")
STOP, PERIOD = GOLDEN["stop_time"], 0.1
OUTPUTS = ("temperature", "limp", "trips")


def held(pieces: list[float]) -> Array:
    """Return the disagreement at every tick of a run, held over pieces of 2 s."""
    return np.append(np.repeat(np.asarray(pieces, float), 20), pieces[-1])


def drive(fmu: Driver, disagreement: Array) -> dict[str, Array]:
    inputs = {"disagreement": disagreement}
    rows = fmu.run(inputs, OUTPUTS, stop_time=STOP, samples=len(disagreement))
    return dict(zip(OUTPUTS, rows.T, strict=True))


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_limp_homes(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, held(run["disagreement"]))
    changes = np.diff(found["limp"])
    begins, ends = (PERIOD * (np.flatnonzero(changes == sign) + 1) for sign in (1, -1))
    # Outputs are read before the input is set, so a jump of the input has its effect one row later.
    assert begins == pytest.approx(np.array(run["limp_from"]) + PERIOD)
    assert ends == pytest.approx(run["limp_until"], abs=PERIOD * 1.01)
    if "cooled" in run:
        row = round(run["cooled"]["time"] / PERIOD)
        assert found["temperature"][row] == pytest.approx(run["cooled"]["temperature"], abs=1e-3)
    if "tripped_at" in run:
        assert np.flatnonzero(found["trips"])[0] * PERIOD == pytest.approx(run["tripped_at"], abs=0.05)
    assert found["trips"][-1] == ("tripped_at" in run)
    assert robustness("HeaterLimpHome", "HeaterLimpHome", found, stop_time=STOP) == run["robustness"]


def test_independent_baths(fmu: Driver) -> None:
    rng = np.random.default_rng(39)
    trips = 0
    for _ in range(200):
        pieces = rng.choice([5.0, 5.0, 7.0, 0.2], 20)
        begin = rng.integers(0, 8)
        pieces[begin : begin + 6] = [7.0, 0.2, 7.0, 5.0, 0.2, 5.0]
        pieces[rng.integers(0, 20)] = rng.uniform(0, 10)
        found, expected = drive(fmu, held(pieces.tolist())), heater(held(pieces.tolist()))
        same = np.diff(held(pieces.tolist()), prepend=pieces[0]) == 0
        for k, output in enumerate(OUTPUTS):
            assert found[output][same] == pytest.approx(expected[same, k], abs=1e-6), output
        trips += int(found["trips"][-1])
    assert 20 < trips < 190


def test_only_the_fault_makes_the_bath_too_hot(fmu: Driver) -> None:
    rng = np.random.default_rng(40)
    for _ in range(100):
        pieces = rng.choice([5.0, 7.0, 0.2], 20)
        inputs = {"disagreement": held(pieces.tolist())}
        always_frozen = {"settling": 0.0}
        rows = fmu.run(inputs, OUTPUTS, stop_time=STOP, samples=401, parameters=always_frozen)
        assert rows[:, 0].max() < 62
        assert rows[-1, 2] == 0
