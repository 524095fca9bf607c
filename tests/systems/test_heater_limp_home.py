import numpy as np
import pytest

from tests.systems.driving import Array, Driver, golden, held

GOLDEN = golden("HeaterLimpHome")
STOP, PERIOD, TICKS = GOLDEN["stop_time"], 0.1, 20
OUTPUTS = ("temperature", "limp", "trips")


def heater(disagreement: Array) -> Array:
    """Return temperature, limp-home mode and trips at every tick of 0.1 s, shape (ticks, 3).

    Args:
        disagreement: difference between the sensors at every tick, in K.
    """
    rows = np.empty((len(disagreement), 3))
    bath, part = 60.0, 50.0
    limp, frozen, tripped = False, False, False
    agreed, ended = 0, -1000000
    for tick, apart in enumerate(disagreement):
        agreed = agreed + 1 if 0.1 < apart < 0.3 else 0
        was_limp = limp
        limp = 6.8 < apart < 7.2 or (limp and agreed < 11)
        if was_limp and not limp:
            ended = tick
        if limp and not was_limp:
            frozen = tick - ended >= 15
        wish = 5 * (60 - bath) + part
        given = min(max(wish, 0.0), 30.0 if limp else 100.0)
        if limp and not frozen:
            part = min(100.0, part + 0.05 * (wish - given))
        if not limp and 0 < wish < 100:
            part += 0.02 * (60 - bath)
        tripped = tripped or bath >= 64
        rows[tick] = bath, limp, tripped
        goal = 20 + 0.8 * (0.0 if tripped else given)
        bath = goal + (bath - goal) * np.exp(-0.1 / 40)
    return rows


def drive(fmu: Driver, disagreement: Array) -> dict[str, Array]:
    return fmu.run({"disagreement": disagreement}, OUTPUTS, stop_time=STOP, samples=len(disagreement))


@pytest.mark.parametrize("name", GOLDEN["runs"])
def test_golden_limp_homes(fmu: Driver, name: str) -> None:
    run = GOLDEN["runs"][name]
    found = drive(fmu, held(run["disagreement"], TICKS))
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


def test_independent_baths(fmu: Driver) -> None:
    rng = np.random.default_rng(39)
    trips = 0
    for _ in range(200):
        pieces = rng.choice([5.0, 5.0, 7.0, 0.2], 20)
        begin = rng.integers(0, 8)
        pieces[begin : begin + 6] = [7.0, 0.2, 7.0, 5.0, 0.2, 5.0]
        pieces[rng.integers(0, 20)] = rng.uniform(0, 10)
        apart = held(pieces.tolist(), TICKS)
        found, expected = drive(fmu, apart), heater(apart)
        same = np.diff(apart, prepend=pieces[0]) == 0
        for k, output in enumerate(OUTPUTS):
            assert found[output][same] == pytest.approx(expected[same, k], abs=1e-6), output
        trips += int(found["trips"][-1])
    assert 20 < trips < 190
