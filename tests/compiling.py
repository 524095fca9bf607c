"""Compiles everything once, so that tests side by side need not each do it: ``python -m tests.compiling``."""

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.search.run import falsify
from falsifier.stl import Monitor, parse
from falsifier.testing import lag_problem


def load_common() -> None:
    """Load the monitor from numba's cache, or compile it."""
    times = np.linspace(0.0, 1.0, 11)
    Monitor(parse("G[0,1] (x < 1)"), step=0.1, samples=11).evaluate(Trajectory(times, {"x": times}))


def load_all() -> None:
    """Load everything that is compiled: monitors, and what the surrogate predicts with."""
    load_common()
    falsify(lag_problem("G[0,10] (x <= 2)"), "surrogate", budget=12)


if __name__ == "__main__":
    load_all()
