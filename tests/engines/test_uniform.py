import numpy as np

from falsifier.engines import make_engine
from falsifier.testing import lag_problem


def test_uniform_fills_the_box() -> None:
    problem = lag_problem()
    points = np.array([problem.space.encode(c) for c in make_engine("uniform", problem, seed=2).ask(400)])
    assert np.abs(points.mean(axis=0)).max() < 0.25
    assert points.min() < -1.95 and points.max() > 1.95
