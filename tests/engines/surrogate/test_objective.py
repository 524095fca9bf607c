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
