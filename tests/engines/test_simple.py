"""Uniform points and corners: the engines that are yardsticks."""

from functools import partial

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.engines.simple import Corners
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.stl import Verdict
from falsifier.testing import START, drive, lag_problem
from tests.engines.support import box_problem
from tests.problems import decades


def test_uniform_points_fill_the_box_alone_or_in_batches() -> None:
    problem = box_problem()
    points = np.array([problem.space.encode(c) for c in make_engine("uniform", problem, seed=2).ask(400)])
    assert np.abs(points.mean(axis=0)).max() < 0.125
    assert points.min() < -0.975 and points.max() > 0.975
    one, other = (make_engine("uniform", problem, seed=7) for _ in range(2))
    assert [c.key for c in one.ask(3)] == [c.key for _ in range(3) for c in other.ask()]


def test_uniform_values_are_even_in_the_decades_of_a_range() -> None:
    asked = make_engine("uniform", decades(), seed=0).ask(700)
    counts, _ = np.histogram(np.log10([c.parameters["bias"] for c in asked]), bins=7, range=(-7, 0))
    assert counts.min() > 70 and counts.max() < 130


def test_corners_come_first_and_each_once() -> None:
    problem = lag_problem(inputs=2, parameters=[START])
    asked = drive(make_engine("corners", problem, seed=1), partial(evaluate, problem), rounds=9)
    corners = {(*(s.values for s in c.signals.values()), *c.parameters.values()) for c in asked[:8]}
    assert len(corners) == 8
    assert all(abs(v) == 1.0 for c in asked[:8] for s in c.signals.values() for v in s.values)
    assert any(abs(v) != 1.0 for s in asked[8].signals.values() for v in s.values)


def test_an_input_without_effect_costs_one_simulation() -> None:
    def judge(candidate: Candidate) -> Evaluation:
        u, _, w = (candidate.signals[name].values[0] for name in "uvw")
        return Evaluation(candidate, verdict=Verdict(3.0 - u - w, 0.0, "u + w <= 3"))

    asked = drive(make_engine("corners", lag_problem(inputs=3), seed=0), judge, rounds=4)
    assert min(judge(c).robustness or 0.0 for c in asked) == 1.0


def levels(candidate: Candidate) -> tuple[float, ...]:
    return tuple(signal.values[0] for signal in candidate.signals.values())


def test_a_failed_corner_is_tried_once_and_never_built_upon() -> None:
    engine = make_engine("corners", lag_problem(inputs=3), seed=3)
    (first,) = engine.ask()
    engine.tell([Evaluation(first, "failed")])
    (second,) = engine.ask()
    engine.tell([Evaluation(second, verdict=Verdict(1.0, 0.0, "x"))])
    (third,) = engine.ask()
    assert len({levels(c) for c in (first, second, third)}) == 3
    assert sum(a != b for a, b in zip(levels(second), levels(third), strict=True)) == 1


def test_a_corner_that_was_heard_of_is_built_upon_and_not_tried() -> None:
    engine = Corners(lag_problem(inputs=2), seed=0)
    engine.hear(np.full(engine.box.dimension, 0.1), 1.0)
    (first,) = engine.ask()
    assert sum(levels(first)) == 0.0, "one input is high, the other low"
    engine.tell([Evaluation(first, verdict=Verdict(2.0, 0.0, "x"))])
    engine.hear(engine.box.point(first), 0.5)
    (second,) = engine.ask()
    assert levels(second) == tuple(-level for level in levels(first)), "its own simulation counts"
    assert not engine.is_done
    assert set(levels(*engine.ask())) == {1.0} and engine.is_done
