import numpy as np
import pytest

from falsifier.engines.surrogate.automaton.automaton import Automaton
from falsifier.engines.surrogate.automaton.guards import Guard
from tests.engines.surrogate.automaton.support import CELL, PUCK, driven

WALLS = (
    Guard(0, 0, 0, 0, -1, 1.0, 1.0, -1.0, 0.0),
    Guard(0, 0, 0, 0, -1, 0.0, -1.0, -0.95, 0.0),
)


def puck(guards: tuple[Guard, ...] = WALLS) -> Automaton:
    laws = np.array([[[-1.0, 0.0, 0.0, 2.0, 0.0]]])
    return Automaton(laws, guards, np.zeros(1, np.intp), 0.01)


@pytest.mark.parametrize("seed", range(3))
def test_events_are_located(seed: int) -> None:
    inputs = driven(1, seed=seed)[0]
    true = PUCK.solve(inputs)
    samples, first = puck().trajectory(inputs[:, None], np.array([0.3]), np.array([1.0]), CELL)
    # A twentieth of a second before it rests, bounces are closer than the reference solves.
    assert samples[first] == pytest.approx(true.outputs[:: round(CELL / 0.01)], abs=1e-4)
    assert samples.max() == pytest.approx(1.0, abs=1e-6)
    assert samples.min() == pytest.approx(0.0, abs=1e-6)


def test_a_puck_at_rest_stays_at_the_wall() -> None:
    lossy = (WALLS[0], Guard(0, 0, 0, 0, -1, 0.0, -1.0, -0.5, 0.0))
    inputs = np.zeros((30, 1))
    samples, first = puck(lossy).trajectory(inputs, np.array([0.3]), np.array([0.0]), CELL)
    assert samples[first[10:]] == pytest.approx(0.0, abs=1e-3)


def test_what_starts_beyond_a_threshold_and_moves_on_has_its_event_at_once() -> None:
    outside = puck((Guard(0, 0, 0, 0, -1, 1.0, 1.0, -1.0, 0.0),))
    inputs = np.full((1, 1), 0.5)
    samples, _ = outside.trajectory(inputs, np.array([2.0]), np.array([1.0]), CELL)
    assert samples[0] == samples[1] == pytest.approx(2.0)
    assert samples[-1] == pytest.approx(2.0 - CELL)


def test_damping_and_stiffness() -> None:
    laws = np.array([[[0.5, -0.2, -4.0]]])
    swing = Automaton(laws, (Guard(0, 0, 0, 0, -1, 1e9, 1.0, 1.0, 0.0),), np.zeros(1, np.intp), 0.01)
    samples, first = swing.trajectory(np.empty((10, 0)), np.array([1.0]), np.array([0.0]), CELL)
    times, decay = np.arange(11) * CELL, 0.1
    rate = np.sqrt(4.0 - decay**2)
    x = (1.0 - 0.125) * np.exp(-decay * times) * (np.cos(rate * times) + decay / rate * np.sin(rate * times))
    assert samples[first][:, 0] == pytest.approx(0.125 + x, abs=1e-4)


def test_too_many_events_end_without_overflow() -> None:
    trap = (Guard(0, 0, 0, 0, -1, 0.0, 1.0, -1.0, 0.0), Guard(0, 0, 0, 0, -1, 0.0, -1.0, -1.0, 0.0))
    samples, first = puck(trap).trajectory(np.ones((2000, 1)), np.array([0.0]), np.array([1.0]), CELL)
    assert len(first) == 2001
    assert first[-1] == len(samples) - 1
    assert np.isfinite(samples).all()
