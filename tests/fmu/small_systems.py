"""Systems of the test FMUs: a plant T x' = u - x and a controller y = k (r - measured) without states."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.fmu import Component, Connection, Coupling, System
from tests.fmu import fixtures
from tests.fmu.fixtures import path

LOOP: dict[str, str | Connection] = {"plant.u": "pi.y", "pi.measured": "plant.y"}
LINEAR = {"plant.u": Connection("pi.y"), "pi.measured": Connection("plant.y", extrapolation="linear")}
STEP = 0.1


def system(
    components: Mapping[str, str | Component],
    connections: Mapping[str, str | Connection],
    coupling: Coupling | None = None,
) -> System:
    found = {n: path(each) if isinstance(each, str) else each for n, each in components.items()}
    return System(found, connections, coupling=coupling or Coupling())


def pids(model: System) -> list[int]:
    workers = [runner._worker for runner in fixtures.runners(model)]
    return [worker.program.pid for worker in workers if worker is not None]


def loop(coupling: Coupling | None = None, *, plant: str = "Plant_2", pi: str = "Gain_2") -> System:
    return system({"plant": plant, "pi": pi}, LOOP, coupling)


def run(model: System, *outputs: str, **given: Any) -> Trajectory:
    """Simulate once, with arguments of the other ``run``."""
    return fixtures.run(model, outputs, **given)


def sampled_loop(late: int, *, steps: int = 10, step: float = STEP) -> NDArray[np.float64]:
    """The plant's exact states at communication points, if its input is some steps late; r = 1, T = k = 2."""
    x, decay = [0.0], float(np.exp(-step / 2.0))
    for k in range(steps):
        u = 2.0 * (1.0 - x[max(k - late, 0)])
        x.append(u + (x[-1] - u) * decay)
    return np.array(x)


def solved(name: str, step: float | None = None) -> Component:
    return Component(path(name), step, "model-exchange")


def component(name: str, step: float) -> Component:
    return Component(path(name), step)
