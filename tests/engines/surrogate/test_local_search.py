"""Search without dynamics: changes of inputs, and the trust region."""

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.model import Experiment, FunctionModel, ModelInfo, Variable
from falsifier.core.space import ParameterRange, SearchSpace
from falsifier.engines.layout import Array, Layout, TimeGrid, planning_layout
from falsifier.engines.surrogate.local_search import TrustRegion, propose_change
from falsifier.engines.surrogate.variation import mutations, switching
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict, parse
from falsifier.testing import FREE, START, drive, lag, lag_problem
from tests.engines.support import flat


def layout_of() -> Layout:
    problem = lag_problem(free=FREE, parameters=[START])
    return planning_layout(problem.space, TimeGrid(0.1, 100, 100))


def no_risk(points: Array) -> Array:
    return np.zeros(len(points))


def test_the_best_are_changed_before_the_time_that_decided() -> None:
    layout, rng = layout_of(), np.random.default_rng(1)
    points = np.repeat(np.linspace(0.2, 0.8, 9)[:, None], 101, axis=1)
    costs, decided = np.arange(9.0), np.full(9, 3.0)
    parents = []
    for _ in range(60):
        point, why = propose_change(layout, points, costs, decided, rng, risk=no_risk, draws=1)
        if why.startswith("random"):
            continue
        same = (np.abs(points - point) < 1e-9).mean(axis=1)
        parents.append(int(np.argmax(same)))
        changes = np.abs(point - points[parents[-1]]) > 1e-9
        assert changes[layout.starts <= 3.0].any(), "a later change alone cannot lower it"
    assert parents.count(0) > 0.5 * len(parents)


def test_risky_changes_are_avoided() -> None:
    layout, rng = layout_of(), np.random.default_rng(3)
    points, costs, decided = np.full((9, 101), 0.5), np.arange(9.0), np.full(9, 10.0)

    def risk(points: Array) -> Array:
        return np.asarray(points.max(axis=1))

    proposed = [
        propose_change(layout, points, costs, decided, rng, risk=risk, draws=12)[0] for _ in range(40)
    ]
    assert np.max(proposed, axis=1).mean() < 0.75


def parameters_problem(kind: str, count: int) -> Problem:
    ranges = tuple(
        ParameterRange(
            f"p{i}", 0, 20, kind="integer" if kind == "integer" or (kind == "mixed" and i % 2) else "real"
        )
        for i in range(count)
    )
    variables = (
        *(Variable(r.name, kind=r.kind, causality="parameter", start=1.0, settable=True) for r in ranges),
        Variable("x", causality="output"),
    )
    return Problem(
        FunctionModel(lag, ModelInfo("bowl", variables=variables)),
        Requirement("BOWL", parse("G (x <= 1)")),
        SearchSpace((), ranges, 1.0),
        Experiment(1.0, 0.1, ("x",)),
    )


@pytest.mark.parametrize("kind", ["real", "integer", "mixed"])
def test_the_trust_region_finds_the_bottom_of_a_bowl_in_few_simulations(kind: str) -> None:
    problem = parameters_problem(kind, 6)
    target = np.array([3.0, 17.0, 8.0, 20.0, 0.0, 11.0])

    def judge(candidate: Candidate) -> Evaluation:
        distance = float(np.abs(problem.space.encode(candidate) - target).sum())
        return Evaluation(candidate, verdict=Verdict(distance, 0.0, "bowl"))

    found = [judge(c).robustness for c in drive(TrustRegion(problem, seed=0), judge, rounds=70)]
    assert min(d for d in found if d is not None) <= 6.0, "uniform points come within about 22"


def test_the_trust_region_starts_again_where_nothing_improves() -> None:
    problem = parameters_problem("real", 2)
    asked = drive(TrustRegion(problem, seed=0), flat, rounds=60)
    starts = [i for i, c in enumerate(asked) if c.rationale.startswith("a new start")]
    assert max(starts) > 20 and len(starts) < 30


def test_changes_near_the_critical_time_leave_what_comes_later_alone() -> None:
    layout = layout_of()
    parents = np.full((1, 101), 0.5)
    rng = np.random.default_rng(0)

    def late_changes(critical: float | None) -> float:
        known = None if critical is None else np.array([critical])
        children = mutations(layout, rng, parents, 400, critical=known)
        return float(np.mean(children[:, 45:100] != 0.5))

    assert late_changes(0.3) < 0.7 * late_changes(None)


def test_switching_inputs_stay_at_a_bound_for_the_dwell() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        point = switching(layout_of(), rng, 2.0)
        assert set(point[:-1].tolist()) <= {0.0, 1.0}
        changes = np.flatnonzero(np.diff(point[:-1]))
        assert (np.diff(changes) >= 19).all(), "20 cells are 2 s"
