import numpy as np
import pytest

from falsifier.core.space import Freedom
from falsifier.engines.coverage.programs import Programs
from falsifier.engines.layout import Layout, TimeGrid, planning_layout
from falsifier.testing import FREE, START, lag_problem
from tests.engines.coverage.support import lock_problem

GRID = TimeGrid.over(10.0, 10.0, cells=50, shortest=0.1)


def layout_of(*, inputs: int) -> Layout:
    return planning_layout(lag_problem(inputs=inputs, free=FREE, parameters=[START]).space, GRID)


def drawn(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("time", [0.0, 3.1, 9.99])
@pytest.mark.parametrize("inputs", [1, 2])
def test_what_follows_a_time_is_drawn_again_and_what_precedes_it_is_kept(time: float, inputs: int) -> None:
    layout = layout_of(inputs=inputs)
    programs = Programs(layout)
    changed = False
    for seed in range(20):
        point = programs.fresh(drawn(seed))
        for other in (
            programs.another_end(drawn(seed + 100), point, time),
            programs.repeated(drawn(seed), point, time, programs.fresh(drawn(seed + 50)), (1.0, 4.0)),
        ):
            for coding, group in zip(layout.codings, layout.groups, strict=False):
                kept = np.asarray(coding.times) <= time
                assert (other[group][kept] == point[group][kept]).all()
            assert other.min() >= 0.0 and other.max() <= 1.0
            changed |= bool((other != point).any())
    assert changed


def test_discrete_inputs_take_their_values_only() -> None:
    layout = planning_layout(lock_problem(free=Freedom(100, 0.1)).space, GRID)
    programs = Programs(layout)
    point = programs.fresh(drawn(1))
    for seed in range(50):
        point = programs.moved(drawn(seed), programs.another_end(drawn(seed), point, 2.0))
        assert point * 5 == pytest.approx(np.round(point * 5))


def test_values_are_drawn_between_levels_that_are_known() -> None:
    layout = layout_of(inputs=1)
    (ranged,) = layout.space.inputs
    width = ranged.high - ranged.low
    low, high = ranged.low + 0.700 * width, ranged.low + 0.701 * width
    levels = {ranged.name: [low, high, ranged.low, ranged.high + 1.0], "another": [0.0]}
    aimed, plain = (
        np.concatenate([p.fresh(drawn(seed))[layout.groups[0]] for seed in range(40)])
        for p in (Programs(layout, levels), Programs(layout))
    )
    inside = [np.mean((values >= 0.6999) & (values <= 0.7011)) for values in (aimed, plain)]
    assert inside[0] > 0.15
    assert inside[1] < 0.02
    assert np.mean(aimed == 0.0) > 0.05, "bounds are still tried"


def test_values_at_which_something_happened_are_used_again() -> None:
    layout = layout_of(inputs=2)
    programs = Programs(layout)
    point = np.full(layout.dimension, 0.7)
    first, second = layout.groups[:2]
    point[first[:10]], point[second] = 0.3, 1.0
    programs.remember(point, 2.0, 0.1)
    fresh = np.array([programs.fresh(drawn(seed)) for seed in range(40)])
    for value in (0.3, 0.7):
        assert np.mean(fresh[:, first] == value) > 0.15, "before and after the change that may have caused it"
    assert np.mean(fresh[:, second] == 0.7) == 0.0
    assert np.mean(fresh[:, second] == 1.0) < 0.5, "bounds are drawn often enough"
