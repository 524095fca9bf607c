import numpy as np

from falsifier.engines import make_engine
from tests.engines.support import NamedEngine, box_problem


class TestContract(NamedEngine):
    engine = "uniform"


def test_it_fills_the_box() -> None:
    problem = box_problem()
    points = np.array([problem.space.encode(c) for c in make_engine("uniform", problem, seed=2).ask(400)])
    assert np.abs(points.mean(axis=0)).max() < 0.125
    assert points.min() < -0.975 and points.max() > 0.975


def test_batches_are_the_same_points_as_single_ones() -> None:
    problem = box_problem()
    one, other = (make_engine("uniform", problem, seed=7) for _ in range(2))
    assert [c.key for c in one.ask(3)] == [c.key for _ in range(3) for c in other.ask()]
