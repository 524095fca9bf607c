from dataclasses import replace

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
