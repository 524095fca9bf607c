import numpy as np
import pytest

from falsifier.engines import make_engine
from falsifier.engines.sobol import Sobol
from falsifier.testing import lag_problem
from tests.engines.support import NamedEngine, box_problem


class TestContract(NamedEngine):
    engine = "sobol"


def test_it_is_more_even_than_random() -> None:
    problem = box_problem()
    points = np.array([problem.space.encode(c) for c in make_engine("sobol", problem, seed=2).ask(64)])
    for column in points.T:
        counts, _ = np.histogram(column, bins=16, range=(-1, 1))
        assert counts.min() == counts.max() == 4


def test_coordinates_beyond_the_table_of_direction_numbers_are_drawn_at_random(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("falsifier.engines.sobol._MAX_DIMENSIONS", 2)
    problem = lag_problem(points=5)
    points = np.array([problem.space.encode(c) for c in Sobol(problem, seed=0).ask(64)])
    even = [len(set(np.histogram(c, bins=16, range=(-1, 1))[0])) == 1 for c in points.T]
    assert even == [True, True, False, False, False]
