"""How long a worker takes to start, until its first simulation has ended; how soon its crash is told.

The crash is that of a process that has simulated before; so it is repeated in a new one, which crashes too.

``python -m bench.worker_start [--rounds N]``
"""

import argparse
import os
import time
from collections.abc import Callable
from statistics import median

from falsifier.core.experiment import Experiment
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel
from tests.fmu.fixtures import path
from tests.fmu.support import CRASH

EXPERIMENT = Experiment(1.0, 0.1, ("y",))


def timed(action: Callable[[], object]) -> float:
    """Return the milliseconds that a call takes."""
    began = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - began)


def crash(model: FmuModel) -> None:
    """Let a worker crash."""
    try:
        model.simulate({}, {"misdeed": CRASH}, EXPERIMENT)
    except SimulationError:
        return
    raise AssertionError("it did not crash")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    rounds = parser.parse_args().rounds
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; minimum (median) of {rounds} in ms")
    lag, misdeeds = FmuModel(path("Lag_2")), FmuModel(path("Misdeeds_2"), logging=True)
    starts, crashes = [], []
    for _ in range(rounds + 1):
        starts.append(timed(lambda: lag.simulate({}, {}, EXPERIMENT)))
        lag.close()
        misdeeds.simulate({}, {}, EXPERIMENT)
        crashes.append(timed(lambda: crash(misdeeds)))
        misdeeds.close()
    for name, values in {
        "start and first simulation": starts[1:],
        "crash, repeated, told": crashes[1:],
    }.items():
        print(f"{name:30} {min(values):.1f} ({median(values):.1f})")


if __name__ == "__main__":
    main()
