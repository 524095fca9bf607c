"""Two correct charge points share a feeder: the fault is between them, and shows in neither alone."""

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.fmu import FmuModel
from falsifier.problem.loading import load_problem
from tests.systems.driving import ROOT, Array

PROBLEM = load_problem("SharedFeeder")
GRID = PROBLEM.experiment.times

PERIOD, LIMIT, WARMING = 0.1, 100.0, 2.0


def loads(left: Array, right: Array, *, start_right: int = 10) -> tuple[Array, Array]:
    """Return both currents at all ticks, for requests in A at these ticks.

    A request acts one tick later. The left one steps first: of the right one it knows the current two ticks
    ago; the right one knows that of one tick ago.
    """
    a, b = np.zeros(len(left)), np.zeros(len(right))
    a[0] = left[0]
    for k in range(1, len(left)):
        a[k] = min(left[k - 1], LIMIT - (b[k - 2] if k > 1 else 0.0))
        b[k] = min(right[k - 1], LIMIT - a[k - 1]) if k >= start_right else 0.0
    return a, b


def heat(load: Array) -> Array:
    """Return the temperature rise at all ticks; the feeder gets the load at the end of each step."""
    rise, decay = np.full(len(load), 0.5), float(np.exp(-PERIOD / WARMING))
    for k in range(1, len(load)):
        settled = (load[k] / LIMIT) ** 2
        rise[k] = settled + (rise[k - 1] - settled) * decay
    return rise


def rising(left: float, right: float) -> Candidate:
    """Requests that rise from 0 to 80 A at these times."""
    times = {"left.request": left, "right.request": right}
    signals = {name: Signal((0.0, time), (0.0, 80.0), "constant") for name, time in times.items()}
    return PROBLEM.space.admit(Candidate(signals, {}))


def test_requests_that_rise_in_the_same_tick_make_it_too_hot_others_do_not() -> None:
    together = evaluate(PROBLEM, rising(5.0, 5.0))
    assert together.robustness == pytest.approx(-0.2157, abs=1e-4)
    assert together.trajectory is not None
    assert together.trajectory["feeder.load"][51:57].tolist() == [160.0, 100.0, 40.0] * 2
    for later in (0.5, 1.0, 5.0):
        robustness = evaluate(PROBLEM, rising(5.0, 5.0 + later)).robustness
        assert robustness is not None and robustness > 0.05


def test_the_coupled_system_is_what_its_equations_say() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        signals = {
            name: Signal.evenly(rng.uniform(0.0, 80.0, 9).tolist(), stop_time=20.0, interpolation="constant")
            for name in ("left.request", "right.request")
        }
        found = evaluate(PROBLEM, Candidate(signals, {})).trajectory
        assert found is not None
        a, b = loads(*(signal.sample(GRID) for signal in signals.values()))
        np.testing.assert_allclose(found["left.current"], a, atol=1e-9)
        np.testing.assert_allclose(found["right.current"], b, atol=1e-9)
        np.testing.assert_allclose(found["feeder.heat"], heat(a + b), atol=1e-5)


def test_each_charge_point_alone_leaves_the_other_what_it_has_published() -> None:
    rng = np.random.default_rng(7)
    charger = FmuModel(ROOT / "fmus" / "ShareCharger.fmu")
    values = {"request": rng.uniform(0.0, 80.0, 200), "other": rng.uniform(0.0, 100.0, 200)}
    signals = {
        n: Signal.evenly(v.tolist(), stop_time=20.0, interpolation="constant") for n, v in values.items()
    }
    current = charger.simulate(signals, {}, Experiment(20.0, 0.1, ("current",)))["current"]
    assert (current[1:] + values["other"] <= 100.0 + 1e-9).all()
    assert (current[1:] <= values["request"] + 1e-9).all() and current.max() > 60.0
    charger.close()


def test_the_violation_is_confirmed_at_half_the_step() -> None:
    confirmation = confirm(PROBLEM, evaluate(PROBLEM, rising(5.0, 5.0)))
    assert confirmation.outcome == "confirmed" and confirmation.halved is not None
