import numpy as np

from falsifier.engines import make_engine
from falsifier.testing import lag_problem


def test_sobol_is_more_even_than_random() -> None:
    problem = lag_problem()
    points = np.array([problem.space.encode(c) for c in make_engine("sobol", problem, seed=2).ask(64)])
    for column in points.T:
        counts, _ = np.histogram(column, bins=16, range=(-2, 2))
        assert counts.min() == counts.max() == 4
