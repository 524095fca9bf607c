"""How long simulations may take."""

import math

import pytest

from falsifier.core.experiment import Experiment
from falsifier.errors import SimulationError
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.process.plan import make_plan
from falsifier.fmu.process.worker import Patience
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated
from tests.fmu.support import HANG

DESCRIPTION = read_description(fixtures.path("Lag_2"))
PLAN = make_plan(DESCRIPTION, Experiment(50.0, 1.0, ("y",)), (), ())


class Clock:
    """Time that passes when the test says so."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        monkeypatch.setattr("time.monotonic", lambda: self.now)


def lasts(clock: Clock, waiting: Patience, pace: float) -> float:
    """Seconds after which a simulation at this pace, in simulated seconds per second, is given up or ends."""
    reached = 0.0
    while reached < PLAN.experiment.stop_time:
        clock.now += waiting.seconds
        reached = pace * clock.now
        try:
            waiting.look(reached)
        except TimeoutError:
            break
    return clock.now


def test_without_a_limit_slow_simulations_go_on_and_hanging_ones_do_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock(monkeypatch)
    assert lasts(clock, Patience(PLAN), pace=0.5) == pytest.approx(100.0, abs=2.0)
    clock.now = 0.0
    assert lasts(clock, Patience(PLAN), pace=0.0) == pytest.approx(60.1)
    clock.now = 0.0
    assert lasts(clock, Patience(PLAN), pace=0.01) == pytest.approx(60.1)


def test_a_limit_of_the_user_is_for_the_whole_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    limited = make_plan(DESCRIPTION, Experiment(50.0, 1.0, ("y",), time_limit=60.0), (), ())
    assert lasts(clock, Patience(limited), pace=0.5) == pytest.approx(60.1)


@pytest.mark.parametrize("told", [math.nan, math.inf, 1e300])
def test_progress_that_an_fmu_makes_up_ends(monkeypatch: pytest.MonkeyPatch, told: float) -> None:
    clock, waiting, count = Clock(monkeypatch), Patience(PLAN), 0
    with pytest.raises(TimeoutError):
        for count in range(10_000):
            clock.now += waiting.seconds
            waiting.look(told * (count + 1))
    assert count < 1000


def test_a_hang_is_ended_where_no_tenth_of_the_time_is_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.fmu.process.plan._DEFAULT_TIME_LIMIT", 0.3)
    model = isolated("Misdeeds_2")
    with pytest.raises(SimulationError, match=r"at t = 0\.5 s .*without another tenth") as caught:
        model.simulate({}, {"misdeed": HANG}, Experiment(1.0, 0.1, ("y",), tolerance=1e-7))
    assert caught.value.status == "timeout" and caught.value.time == 0.5
