from dataclasses import replace

import numpy as np
import pytest

from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import FREE, START, lag_problem
from tests.engines.surrogate.support import history_of


def test_history_skips_what_has_no_trajectory_and_keeps_failures_out() -> None:
    problem = lag_problem(free=FREE, parameters=[START])
    history = history_of(problem, simulations=2)
    evaluation = evaluate(problem, history.layout.candidate(history.points[0], origin="t", rationale="t"))
    assert history.add(replace(evaluation, trajectory=None), "t") is None
    assert history.add(replace(evaluation, status="failed", verdict=None), "t") is None
    assert len(history.samples) == 2


def test_samples_remember_who_proposed_them_and_when_they_were_decided() -> None:
    problem = lag_problem(free=FREE)
    history = history_of(problem, simulations=1)
    candidate = history.layout.candidate(np.ones(history.layout.dimension), origin="t", rationale="t")
    sample = history.add(evaluate(problem, candidate), "an arm")
    assert sample is not None
    assert (sample.arm, sample.critical) == ("an arm", 1.0)
    assert sample.point == pytest.approx(np.ones(history.layout.dimension))
    assert history.points.shape == (2, history.layout.dimension)
    assert history.direct_costs() == [s.robustness for s in history.samples], "it has a slope"


def test_scales_are_those_of_all_samples_so_far() -> None:
    problem = lag_problem(free=FREE)
    history = history_of(problem, simulations=1)
    before = history.scaled_objective().scales
    assert history.scaled_objective() is history.scaled_objective()
    candidate = history.layout.candidate(np.zeros(history.layout.dimension), origin="t", rationale="t")
    history.add(evaluate(problem, candidate), "t")
    assert history.scaled_objective().scales != before
