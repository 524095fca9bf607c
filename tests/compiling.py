"""Compiles every loop once, so that tests side by side need not each do it: ``python -m tests.compiling``."""

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.fmu import machine_code, master, readiness, system_solver
from falsifier.search.run import falsify
from falsifier.stl import Monitor, parse
from falsifier.testing import lag_problem


def load_common() -> None:
    """Load the monitor and the stepper of co-simulation from numba's cache, or compile them."""
    readiness.load_first(print)
    times = np.linspace(0.0, 1.0, 11)
    Monitor(parse("G[0,1] (x < 1)"), step=0.1, samples=11).evaluate(Trajectory(times, {"x": times}))


def load_all() -> None:
    """Load everything that is compiled: monitors, what the surrogate predicts with, and the steppers."""
    load_common()
    falsify(lag_problem("G[0,10] (x <= 2)"), "surrogate", budget=12)
    machine_code.load("model_exchange")
    master.warm_up()
    system_solver.warm_up()


if __name__ == "__main__":
    load_all()
