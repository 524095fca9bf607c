from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from falsifier.engines.layout import TimeGrid, planning_layout
from falsifier.engines.surrogate.feasibility import Feasibility
from falsifier.engines.surrogate.surrogate import Surrogate
from falsifier.record.run import falsify
from falsifier.testing import Array, lag, lag_problem
from tests.engines.support import HASTY


def diverges(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Fail in more than half of the range of the input, at both of its ends."""
    if np.abs(inputs["u"]).max() > 0.4:
        raise RuntimeError("the solver does not converge")
    return lag(times, inputs, parameters)


def test_the_risk_grows_towards_failures() -> None:
    points = np.linspace(0.0, 1.0, 9)[:, None]
    grid = TimeGrid(1.0, 10, 10)
    feasibility = Feasibility(planning_layout(lag_problem(points=1).space, grid), grid)
    for point in points:
        feasibility.add(point, failed=bool(point[0] > 0.6))
    risk = feasibility.risk(np.array([[0.0], [0.25], [0.75], [1.0]]))
    assert (np.diff(risk) > 0).all()
    assert risk[0] < 0.1 < 0.5 < risk[2]


def test_the_engine_avoids_regions_in_which_simulations_fail() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=diverges, points=1)
    failures = {}
    for label, settings in {"learns": HASTY, "does not": replace(HASTY, retries=0, risk_weight=0.0)}.items():
        runs = [falsify(problem, Surrogate(problem, seed=s, settings=settings), budget=15) for s in range(3)]
        failures[label] = sum(run.spent.failed for run in runs)
    assert failures["learns"] < 0.8 * failures["does not"], failures


def test_a_violation_next_to_failures_is_found() -> None:
    problem = lag_problem("G[0,10] (x <= 0.3)", response=diverges, points=3)
    for seed in range(3):
        result = falsify(problem, Surrogate(problem, seed=seed), budget=40)
        assert result.falsified, result.reason
