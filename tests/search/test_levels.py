from math import nan

from falsifier.search.levels import Level, level_results, reached
from falsifier.testing import lag_problem

SPACE = lag_problem().space
STARTS = (0, 4, 8)


def test_levels_begin_with_their_first_simulation() -> None:
    levels = [Level(first, SPACE) for first in STARTS]
    assert [len(reached(levels, n)) for n in (0, 1, 4, 5, 8, 9)] == [1, 1, 1, 2, 2, 3]


def test_what_came_of_each_level_is_told() -> None:
    found = level_results(STARTS, [3.0, 1.0, None, 2.0, nan, None], falsified=False)
    assert [f"{level.name}: {level.text}" for level in found] == [
        "level 1 of 3: 4 simulations, smallest robustness +1",
        "level 2 of 3: 2 simulations, all failed",
        "level 3 of 3: not begun",
    ]


def test_the_level_of_the_counterexample_is_told() -> None:
    for count, level in ((1, 0), (4, 0), (5, 1), (8, 1), (9, 2)):
        found = level_results(STARTS, [1.0] * (count - 1) + [-1.0], falsified=True)
        assert [each.falsified for each in found].index(True) == level
        assert sum(each.falsified for each in found) == 1
