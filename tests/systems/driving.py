"""Drives a bundled FMU by plain FMI 2.0 co-simulation calls: held inputs, one step, outputs."""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.signals import Signal
from falsifier.stl import Monitor, parse
from falsifier.trajectory import Trajectory

ROOT = Path(__file__).parents[2]
Array = NDArray[np.float64]


def golden(system: str) -> dict[str, Any]:
    """Golden figures of a system."""
    return tomllib.loads((Path(__file__).parent / "golden" / f"{system}.toml").read_text())


def evenly(values: list[float], stop_time: float) -> Signal:
    """Pchip signal over evenly spaced control points."""
    return Signal.evenly(values, stop_time=stop_time)


@dataclass(frozen=True, slots=True)
class Driver:
    """One instance of an FMU, used for one run after the other.

    Attributes:
        instance: fmpy's FMI 2.0 slave.
        description: fmpy's model description.
    """

    instance: Any
    description: Any

    def run(
        self,
        inputs: Mapping[str, Array],
        outputs: tuple[str, ...],
        *,
        stop_time: float,
        samples: int,
        parameters: Mapping[str, float] | None = None,
    ) -> Array:
        """Outputs on the evenly spaced grid of the inputs, shape (samples, outputs).

        Args:
            inputs: values at every grid time, each held until the next one.
            outputs: names of real or integer variables.
            stop_time: last grid time in s.
            samples: number of grid times, both ends included.
            parameters: values set before the start.
        """
        fmu = self.instance
        variables = {v.name: v for v in self.description.modelVariables}
        driven = [variables[name].valueReference for name in inputs]
        rows = np.column_stack([*inputs.values()]).tolist() if inputs else [[]] * samples
        reals = [i for i, name in enumerate(outputs) if variables[name].type == "Real"]
        integers = [i for i, name in enumerate(outputs) if variables[name].type == "Integer"]
        real_references = [variables[outputs[i]].valueReference for i in reals]
        integer_references = [variables[outputs[i]].valueReference for i in integers]
        result = np.empty((samples, len(outputs)))

        def record(k: int) -> None:
            if reals:
                result[k, reals] = fmu.getReal(real_references)
            if integers:
                result[k, integers] = fmu.getInteger(integer_references)

        fmu.reset()
        fmu.setupExperiment(startTime=0.0, stopTime=stop_time)
        for name, value in (parameters or {}).items():
            fmu.setReal([variables[name].valueReference], [value])
        fmu.enterInitializationMode()
        if driven:
            fmu.setReal(driven, rows[0])
        fmu.exitInitializationMode()
        record(0)
        grid = np.linspace(0.0, stop_time, samples).tolist()
        for k in range(samples - 1):
            if driven:
                fmu.setReal(driven, rows[k])
            fmu.doStep(grid[k], grid[k + 1] - grid[k])
            record(k + 1)
        fmu.terminate()
        return result


@contextmanager
def driver(system: str) -> Iterator[Driver]:
    """Load the bundled FMU of a system."""
    import shutil

    import fmpy
    from fmpy.fmi2 import FMU2Slave

    path = ROOT / "fmus" / f"{system}.fmu"
    description = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=system,
    )
    slave.instantiate()
    try:
        yield Driver(slave, description)
    finally:
        slave.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


def robustness(requirement: str, system: str, columns: Mapping[str, Array], *, stop_time: float) -> float:
    """Robustness of a requirement of a spec file on signals over [0, stop_time]."""
    spec = tomllib.loads((ROOT / "specs" / f"{system}.toml").read_text())
    formula = parse(spec["requirements"][requirement]["formula"])
    times = np.linspace(0.0, stop_time, len(next(iter(columns.values()))))
    monitor = Monitor(formula, stop_time / (len(times) - 1), len(times))
    return monitor.evaluate(Trajectory(times, columns)).robustness
