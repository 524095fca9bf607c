from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.signals import Interpolation, Signal
from falsifier.core.space import SearchSpace
from falsifier.engines.box import BoxEngine, Proposal
from falsifier.engines.layout import Array, Coding, Layout, TimeGrid, fixed_layout, planning_layout
from falsifier.engines.surrogate.variation import mutations, random_points, stepping, switching
from falsifier.evaluation.evaluate import Evaluation
from falsifier.stl import Verdict
from falsifier.testing import FREE, START, lag_problem


def test_layouts_keep_to_the_allowed_parameterization() -> None:
    free, fixed = (lag_problem(free=free, inputs=2, parameters=[START]) for free in (FREE, None))
    grid = TimeGrid(0.1, 100, 100)
    rng = np.random.default_rng(0)
    for problem in (free, fixed):
        layout = planning_layout(problem.space, grid)
        points = [*random_points(layout, rng, 5), switching(layout, rng, 0.7), stepping(layout, rng, 12)]
        points += list(mutations(layout, rng, np.array(points), 20, critical=np.full(7, 0.5)))
        for point in points:
            candidate = layout.candidate(point, origin="t", rationale="t")
            assert problem.space.admit(candidate).key == candidate.key
            assert layout.point(candidate) == pytest.approx(point, abs=1e-9)
    assert len(planning_layout(free.space, grid).codings[0].times) == 100
    assert len(planning_layout(fixed.space, grid).codings[0].times) == 4
    for pieces in (10, 11):  # in few cells, a search is one of control points
        layout = planning_layout(free.space.freed(10.0 / pieces), grid)
        assert layout.is_fine == (pieces > 10, pieces > 10, False)


def test_points_are_settled_where_their_candidates_are() -> None:
    items = (("off", 1), ("low", 2), ("high", 7))
    switch = InputRange("b", 0.0, 1.0, kind="boolean", free=FREE)
    still = InputRange("still", 0.5, 0.5, free=FREE)
    real = InputRange("u", -1.0, 1.0, free=FREE)
    gear = ParameterRange("gear", 0.5, 3.7, kind="integer")
    mode = ParameterRange("mode", 1.0, 7.0, kind="enumeration", items=items)
    space = SearchSpace((switch, still, real), (gear, mode), 10.0)
    grid = TimeGrid(0.1, 100, 100)
    layout = planning_layout(space, grid)
    points = np.random.default_rng(0).random((20, layout.dimension))
    settled = layout.settled(points)
    for point, simulated in zip(points, settled, strict=True):
        candidate = layout.candidate(point, origin="t", rationale="t")
        assert layout.point(candidate) == pytest.approx(simulated, abs=1e-9)
        assert layout.settled(point) == pytest.approx(simulated, abs=1e-9)
    assert layout.settled(settled) == pytest.approx(settled, abs=1e-9)
    assert layout.has_gaps

    all_real = planning_layout(SearchSpace((real,), (), 10.0), grid)
    assert not all_real.has_gaps
    drawn = random_points(all_real, np.random.default_rng(0), 3)
    assert all_real.settled(drawn) is drawn


@pytest.mark.parametrize(("interpolation", "back"), [("constant", 0), ("linear", 1), ("pchip", 2)])
def test_no_coordinate_has_an_effect_before_it_starts(interpolation: Interpolation, back: int) -> None:
    times = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)
    space = lag_problem(free=None, inputs=1, parameters=[START]).space
    layout = Layout(space, (Coding(times, interpolation, free=False),))
    assert layout.starts.tolist() == [times[max(i - back, 0)] for i in range(6)] + [0.0]
    grid = TimeGrid(0.1, 100, 100)
    point = np.random.default_rng(0).random(7)
    before = layout.inputs(point[None], grid)[0, :, 0]
    for i, start in enumerate(layout.starts[:5]):
        other = point.copy()
        other[i] = 1.0 - other[i]
        after = layout.inputs(other[None], grid)[0, :, 0]
        assert after[grid.middles < start] == pytest.approx(before[grid.middles < start])
        if interpolation != "pchip":  # whose slopes keep to zero at extremes
            assert grid.middles[np.abs(after - before) > 1e-9][0] < start + 2.0


PROBLEM = lag_problem(inputs=2, limit=2.0, free=FREE, parameters=[START])
BOX = fixed_layout(PROBLEM.space)


class Noting(BoxEngine):
    """Proposes random points and notes what it is told."""

    name = "noting"

    def __init__(self) -> None:
        super().__init__(PROBLEM, seed=5)
        self.learnt: list[tuple[Array, float | None]] = []

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "a reason")

    def _learn(self, point: Array, evaluation: Evaluation) -> None:
        self.learnt.append((point, evaluation.robustness))


def test_an_engine_is_told_points_and_costs_and_no_candidates_of_another_form() -> None:
    engine = Noting()
    first, second = engine.ask(2)
    foreign = PROBLEM.space.admit(replace(first, signals={n: Signal((0.0,), (0.0,)) for n in "uv"}))
    verdict = Verdict(0.25, 1.0, "x <= 0.9")
    engine.tell(
        [
            Evaluation(first, verdict=verdict),
            Evaluation(second, "failed"),
            Evaluation(foreign, verdict=verdict),
        ]
    )
    assert [cost for _, cost in engine.learnt] == [0.25, None]
    np.testing.assert_allclose(engine.learnt[0][0], BOX.point(first))
