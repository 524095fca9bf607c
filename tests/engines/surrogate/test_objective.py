from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import FREE, lag_problem
from tests.engines.surrogate.support import history_of


def test_an_envelope_sees_the_peak_between_two_grid_points() -> None:
    problem = lag_problem("G[0,10] (x <= 3)", free=FREE)
    history = history_of(problem, simulations=1)
    times = np.linspace(0, 10, 101)
    spike = np.where(np.abs(times - 5.1) < 0.01, 2.0, 0.0)
    candidate = history.layout.candidate(np.full(history.layout.dimension, 0.5), origin="t", rationale="t")
    spiked = evaluate(problem, candidate)
    assert spiked.trajectory is not None
    columns = {**spiked.trajectory.columns, "x": spike}
    sample = history.add(replace(spiked, trajectory=Trajectory(times, columns)), "t")
    assert sample is not None and history.objective is not None
    assert np.abs(sample.trace.states[:, 0]).max() == 0.0
    assert history.objective.cost(sample.values)[0] == pytest.approx(1.0)


def test_scales_come_from_what_was_seen_and_offsets_are_limited() -> None:
    history = history_of(lag_problem("G[0,10] (x <= 3) and G[0,10] (u <= 2)", free=FREE), simulations=4)
    assert history.objective is not None
    seen = [s.values for s in history.samples]
    scaled = history.objective.rescaled(seen)
    spread = [float(np.std(np.concatenate([values[i] for values in seen]))) for i in range(2)]
    assert scaled.scales == pytest.approx(spread)
    shifted = scaled.shifted([10.0, -1e-3], limit=0.25)
    assert shifted.offsets == pytest.approx((0.25 * spread[0], -1e-3))
    plain = shifted.plain()
    assert plain.scales == (1.0, 1.0) and plain.offsets == shifted.offsets


def test_without_scales_the_cost_is_the_robustness_on_the_grid() -> None:
    problem = lag_problem("G[0,10] (x <= 3)", free=FREE)
    history = history_of(problem, simulations=3)
    assert history.objective is not None
    for sample in history.samples:
        assert history.objective.cost(sample.values)[0] == pytest.approx(sample.robustness, abs=1e-9)
        (verdict,) = history.objective.verdicts(sample.values)
        assert verdict.predicate == "x <= 3"
        assert verdict.critical_time == pytest.approx(10.0 * sample.critical, abs=0.21), "within a cell"
