"""The direct search: changes of the best inputs that can matter, in rounds."""

from dataclasses import replace

import numpy as np
import pytest

from falsifier.engines.box import Array
from falsifier.engines.grid import Grid
from falsifier.engines.layout import Layout, planning_layout
from falsifier.engines.surrogate.direct import Seen, propose, round_start
from falsifier.testing import FREE, START, lag_problem
from tests.engines.surrogate.support import SETTINGS

GRID = Grid.over(10.0, 10.0, cells=100, shortest=0.05)


def layout_of(*, free: bool) -> Layout:
    problem = lag_problem(free=FREE if free else None, inputs=2, parameters=[START])
    return planning_layout(problem.space, GRID)


def seen_of(layout: Layout, costs: list[float], *, decided: float, seed: int = 0) -> Seen:
    points = np.random.default_rng(seed).random((len(costs), layout.dimension))
    return Seen(points, np.array(costs), np.full(len(costs), decided))


@pytest.mark.parametrize("free", [True, False])
def test_a_change_is_near_a_good_point_and_before_its_cost_was_decided(free: bool) -> None:
    layout = layout_of(free=free)
    seen = seen_of(layout, [float(i) for i in range(40, 0, -1)], decided=4.0)
    rng = np.random.default_rng(1)
    near = []
    for _ in range(60):
        draw = propose(seen, layout, SETTINGS, rng)
        assert draw.point.shape == (layout.dimension,) and 0.0 <= draw.point.min() <= draw.point.max() <= 1.0
        if draw.why.startswith("random"):
            continue
        same = np.abs(seen.points - draw.point) < 1e-9
        parent = int(np.argmax(same.mean(axis=1)))
        near.append(parent)
        assert (layout.starts[~same[parent]] <= 4.0).any()
    assert 50 < len(near) < 60, "most are changes, some random points"
    assert np.mean(np.array(near) >= 36) > 0.8, "the last ones are the best"


def test_a_system_is_led_to_the_lowest_cost() -> None:
    layout = layout_of(free=False)
    target = np.linspace(0.1, 0.9, layout.dimension)
    rng = np.random.default_rng(0)
    points, costs = list(rng.random((8, layout.dimension))), []
    costs = [float(((point - target) ** 2).sum()) for point in points]
    for _ in range(150):
        seen = Seen(np.array(points), np.array(costs), np.full(len(costs), np.inf))
        points.append(propose(seen, layout, SETTINGS, rng).point)
        costs.append(float(((points[-1] - target) ** 2).sum()))
    assert min(costs) < 0.25 * min(costs[:8])


def test_a_round_ends_when_nothing_improves() -> None:
    falling = np.arange(50.0, 0.0, -1.0)
    assert round_start(falling, 5) == 0
    assert round_start(np.concatenate([falling, np.full(4, 3.0)]), 5) == 0
    assert round_start(np.concatenate([falling, np.full(5, 3.0)]), 5) == 55
    assert round_start(np.concatenate([falling, np.full(5, 3.0), [9.0, 8.0]]), 5) == 55
    assert round_start(np.full(20, 1.0), 5) == 18, "a plateau does not improve"


def test_a_new_round_begins_with_random_points() -> None:
    layout = layout_of(free=True)
    stuck = seen_of(layout, [1.0, *(2.0 for _ in range(SETTINGS.direct_patience))], decided=10.0)
    rng = np.random.default_rng(7)
    for _ in range(20):
        draw = propose(stuck, layout, SETTINGS, rng)
        assert draw.why.startswith("random")
        point = draw.point
        assert (np.abs(stuck.points - point) > 1e-9).all()


def test_the_least_risky_is_proposed() -> None:
    layout = layout_of(free=True)
    seen = seen_of(layout, [3.0, 2.0, 1.0] * 4, decided=10.0)
    rng = np.random.default_rng(0)

    def risk(points: Array) -> Array:
        return np.asarray(points[:, -1] > 0.5, dtype=np.float64)

    proposed = np.array([propose(seen, layout, SETTINGS, rng, risk).point for _ in range(30)])
    assert (proposed[:, -1] <= 0.5).all()


def test_a_cost_that_the_start_decides_depends_on_parameters_and_first_levels() -> None:
    layout = layout_of(free=True)
    seen = seen_of(layout, [float(i) for i in range(40, 0, -1)], decided=0.0)
    rng = np.random.default_rng(0)
    for _ in range(60):
        draw = propose(seen, layout, SETTINGS, rng)
        if draw.why.startswith("random"):
            continue
        same = (np.abs(seen.points - draw.point) < 1e-9).mean(axis=1)
        changed = np.abs(seen.points[int(np.argmax(same))] - draw.point) > 1e-9
        assert (layout.starts[changed] == 0.0).any()


def test_where_nothing_can_change_the_cost_points_are_random() -> None:
    layout = layout_of(free=False)
    late = Layout(layout.space, tuple(replace(c, times=(1.0, *c.times[1:])) for c in layout.codings))
    late = replace(late, space=replace(late.space, parameters=()))
    seen = seen_of(late, [float(i) for i in range(40, 0, -1)], decided=0.5)
    rng = np.random.default_rng(0)
    assert all(propose(seen, late, SETTINGS, rng).why.startswith("random") for _ in range(20))
