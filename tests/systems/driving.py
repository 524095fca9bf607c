"""Drives the bundled FMUs with inputs on a grid, and judges what comes out by the spec files."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.fmu import FmuModel
from falsifier.stl import Monitor, parse

ROOT = Path(__file__).parents[2]
Array = NDArray[np.float64]


def golden(system: str) -> dict[str, Any]:
    """Golden figures of a system."""
    return tomllib.loads((Path(__file__).parent / "golden" / f"{system}.toml").read_text())


def held(pieces: Sequence[float], ticks: int) -> Array:
    """Equal pieces of so many ticks each; the last value also holds at the end."""
    return np.append(np.repeat(np.asarray(pieces, float), ticks), float(pieces[-1]))


def evenly(values: list[float], stop_time: float) -> Signal:
    """Pchip signal over evenly spaced control points."""
    return Signal.evenly(values, stop_time=stop_time)


@dataclass(frozen=True, slots=True)
class Driver:
    """A bundled FMU, driven by inputs that are held over the steps of a grid."""

    model: FmuModel  # simulated by co-simulation

    def run(
        self,
        inputs: Mapping[str, Array],
        outputs: tuple[str, ...],
        *,
        stop_time: float,
        samples: int,
        parameters: Mapping[str, float] | None = None,
    ) -> dict[str, Array]:
        """Outputs by name on the evenly spaced grid of the inputs, shape (samples,) each.

        Inputs are values at every grid time, each held until the next one; both ends are grid times.
        """
        grid = tuple(np.linspace(0.0, stop_time, samples).tolist())
        held = {name: Signal(grid, tuple(u.tolist()), "constant") for name, u in inputs.items()}
        experiment = Experiment(stop_time, stop_time / (samples - 1), outputs)
        trajectory = self.model.simulate(held, parameters or {}, experiment)
        return {name: trajectory[name] for name in outputs}


def robustness(requirement: str, system: str, columns: Mapping[str, Array], *, stop_time: float) -> float:
    """Robustness of a requirement of a spec file on signals over [0, stop_time]."""
    spec = tomllib.loads((ROOT / "specs" / f"{system}.toml").read_text())
    formula = parse(spec["requirements"][requirement]["formula"])
    times = np.linspace(0.0, stop_time, len(next(iter(columns.values()))))
    monitor = Monitor(formula, stop_time / (len(times) - 1), len(times))
    return monitor.evaluate(Trajectory(times, columns)).robustness
