from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.engines.box import BoxEngine, Proposal, Vector
from falsifier.engines.layout import fixed_layout
from falsifier.evaluation.evaluate import Evaluation
from falsifier.stl import Verdict
from falsifier.testing import FREE, START, lag_problem

PROBLEM = lag_problem(inputs=2, limit=2.0, free=FREE, parameters=[START])
BOX = fixed_layout(PROBLEM.space)


def test_points_outside_are_brought_to_the_bounds() -> None:
    candidate = BOX.candidate(np.full(BOX.dimension, 1.5), origin="", rationale="")
    assert set(candidate.signals["u"].values) == {2.0}


def test_a_free_signal_is_read_at_the_fixed_control_points_and_does_not_represent_a_point() -> None:
    step = Candidate(
        {"u": Signal((0.0, 5.0), (-2.0, 2.0), "constant"), "v": Signal((0.0,), (0.0,), "constant")},
        {"x0": -1.0},
    )
    assert not BOX.represents(step)
    assert BOX.point(step).tolist() == [0, 0, 1, 1, 0.5, 0.5, 0.5, 0.5, 0]


def test_a_range_of_one_value_has_a_coordinate_without_effect() -> None:
    (u,) = lag_problem().space.inputs
    box = fixed_layout(replace(lag_problem().space, inputs=(replace(u, low=0.5, high=0.5),)))
    candidate = box.candidate(np.array([0.0, 0.3, 0.7, 1.0]), origin="", rationale="")
    assert set(candidate.signals["u"].values) == {0.5}
    assert box.point(candidate).tolist() == [0.0] * 4


class Noting(BoxEngine):
    """Proposes random points and notes what it is told."""

    name = "noting"

    def __init__(self) -> None:
        super().__init__(PROBLEM, seed=5)
        self.learnt: list[tuple[Vector, float | None]] = []

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "a reason")

    def _learn(self, point: Vector, cost: float | None) -> None:
        self.learnt.append((point, cost))


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


@pytest.mark.parametrize("wanted", [0, 1, 3])
def test_at_least_one_candidate_is_given_each_with_origin_and_reason(wanted: int) -> None:
    candidates = Noting().ask(wanted)
    assert len({c.key for c in candidates}) == len(candidates) == max(wanted, 1)
    assert {(c.origin, c.rationale) for c in candidates} == {("noting", "a reason")}
