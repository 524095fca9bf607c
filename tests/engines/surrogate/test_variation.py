"""Search without dynamics: changes of inputs."""

import numpy as np

from falsifier.engines.layout import Array, Layout, TimeGrid, planning_layout
from falsifier.engines.surrogate.variation import mutations, propose_change, switching
from falsifier.testing import FREE, START, lag_problem


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
        parents.append(int(np.argmax((np.abs(points - point) < 1e-9).mean(axis=1))))
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
        assert (np.diff(np.flatnonzero(np.diff(point[:-1]))) >= 19).all(), "20 cells are 2 s"
