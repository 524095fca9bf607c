import numpy as np

from falsifier.engines.random_change import random_change
from falsifier.testing import START, lag_problem

SPACE = lag_problem(parameters=[START]).space
BEST = SPACE.decode([1.0, -1.0, 0.0, 0.5, 0.25])


def test_at_least_one_number_changes_and_all_stay_in_their_ranges() -> None:
    for seed in range(30):
        found = random_change(SPACE, BEST, seed=(seed,))
        vector = SPACE.encode(found)
        changed = vector != SPACE.encode(BEST)
        assert changed.sum() >= 1
        assert np.all(np.abs(vector) <= 1)
        assert found == random_change(SPACE, BEST, seed=(seed,))


def test_not_everything_changes_each_time() -> None:
    changes = [
        (SPACE.encode(random_change(SPACE, BEST, seed=(s,))) != SPACE.encode(BEST)).sum() for s in range(30)
    ]
    assert min(changes) == 1 and max(changes) < 5


def test_without_a_sample_a_point_is_drawn() -> None:
    points = {random_change(SPACE, None, seed=(s,)).key for s in range(5)}
    assert len(points) == 5
