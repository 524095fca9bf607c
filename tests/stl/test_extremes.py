import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.stl import Monitor, parse


def test_conditions_disjuncts_and_predicates_are_watched_where_they_count() -> None:
    monitor = Monitor(parse("G[0,2] (x >= 3 -> (y <= 1 or x <= 9))"), step=1.0, samples=4)
    parts = [(str(w.formula), str(w.part.formula)) for w in monitor.watched]
    assert parts == [
        ("x >= 3 -> (y <= 1 or x <= 9)", "x >= 3"),
        ("x >= 3", "x >= 3"),
        ("y <= 1 or x <= 9", "y <= 1"),
        ("y <= 1 or x <= 9", "x <= 9"),
        ("y <= 1", "y <= 1"),
        ("x <= 9", "x <= 9"),
    ]
    # The last sample is outside the window and does not count.
    columns = {"x": np.array([0.0, 2.0, 1.0, 50.0]), "y": np.array([5.0, 0.0, 0.0, -50.0])}
    found = monitor.extremes(Trajectory(np.arange(4.0), columns))
    assert (found.lows[0], found.lowest[0]) == (-3.0, 0.0)
    assert (found.highs[0], found.highest[0]) == (-1.0, 1.0)
    assert (found.lows[2], found.highs[2]) == (-4.0, 1.0)
