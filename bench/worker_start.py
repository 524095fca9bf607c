"""How long a worker takes to start, forked and spawned, with a warm cache of compiled loops.

``python -m bench.worker_start [--rounds N]``

For each round and way: seconds until a worker has loaded an FMU, with a nursery that is ready, and with no
program waiting in advance. For spawned ones also the processor time, which other programs change less.
"""

import argparse
import os
import resource
import time
from statistics import median

from falsifier.core.model import Experiment
from falsifier.fmu import FmuModel
from falsifier.fmu.forking import Nursery
from falsifier.fmu.isolation import IsolatedFmu
from falsifier.fmu.simulator import _order, _task
from falsifier.fmu.spawning import Spawner
from falsifier.fmu.starting import Starter
from tests.fmu.fixtures import path


def started(starter: Starter) -> float:
    """Return the seconds until a worker has loaded the FMU."""
    model = FmuModel(path("Lag_2"))
    fmu = IsolatedFmu(lambda: starter, _order(model))
    began = time.perf_counter()
    fmu.load(_task(model, Experiment(1.0, 0.1, ("y",)), (), (), 1).plan)
    seconds = time.perf_counter() - began
    fmu.close()
    return seconds


def spawned() -> tuple[float, float]:
    """Return the seconds, and those of processor time, of a spawned worker without a program in advance."""
    began, before = time.perf_counter(), used()
    spawner = Spawner()
    started(spawner)
    seconds = time.perf_counter() - began
    spawner.close()
    return seconds, used() - before


def used() -> float:
    """Return the processor time of all processes that this one has started and that have ended, in s."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    rounds = parser.parse_args().rounds
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; minimum (median) of {rounds} in s")
    nursery = Nursery()
    started(nursery)
    spawned()
    forked, found = [], []
    for _ in range(rounds):
        forked.append(started(nursery))
        found.append(spawned())
    nursery.close()
    rows = {
        "forked": forked,
        "spawned": [seconds for seconds, _ in found],
        "spawned, processor time": [processor for _, processor in found],
    }
    for name, values in rows.items():
        print(f"{name:24} {min(values):.3f} ({median(values):.3f})")


if __name__ == "__main__":
    main()
