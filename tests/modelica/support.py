"""Drives FMUs for the tests through fmpy, call by call."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel

Floats = npt.NDArray[np.float64]
INTERFACES: tuple[Interface, ...] = ("co-simulation", "model-exchange")
Inputs = Callable[[float], Mapping[str, float]]


class Instance:
    """One instance of an FMI 2.0 FMU, with variables by name."""

    def __init__(self, fmu: Any, description: Any) -> None:
        self.fmu = fmu
        self.variables = {v.name: v for v in description.modelVariables}
        self.time = 0.0

    def start(self, time: float = 0.0, **values: float) -> Instance:
        """Initialize, with start values, parameters and inputs."""
        self.fmu.setupExperiment(startTime=time)
        self.fmu.enterInitializationMode()
        self.set(values)
        self.fmu.exitInitializationMode()
        self.time = time
        return self

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            variable = self.variables[name]
            getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def get(self, name: str) -> float:
        variable = self.variables[name]
        return float(getattr(self.fmu, f"get{variable.type}")([variable.valueReference])[0])

    def row(self, names: Sequence[str]) -> list[float]:
        return [self.get(name) for name in names]

    def step(self, size: float) -> None:
        self.fmu.doStep(self.time, size)
        self.time += size

    def run(self, names: Sequence[str], stop: float, size: float, inputs: Inputs | None = None) -> Floats:
        """Columns: time and the named variables; rows: the start and every communication point."""
        rows = [[self.time, *self.row(names)]]
        begin = self.time
        for k in range(round((stop - begin) / size)):
            self.time = begin + k * size
            if inputs:
                self.set(inputs(self.time))
            self.fmu.doStep(self.time, size)
            self.time = begin + (k + 1) * size
            rows.append([self.time, *self.row(names)])
        return np.array(rows)


@contextmanager
def opened(path: Path, count: int = 1) -> Iterator[list[Instance]]:
    """Instances of one FMU in this process, by co-simulation."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    description = read_model_description(str(path), validate=True)
    folder = extract(str(path))
    made = []
    for k in range(count):
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=f"instance {k}",
        )
        fmu.instantiate()
        made.append(Instance(fmu, description))
    yield made
    for instance in made:  # fmpy's freeInstance closes the library as well, so only the last one may use it
        instance.fmu.fmi2FreeInstance(instance.fmu.component)
    shutil.rmtree(folder, ignore_errors=True)


def said_on_failure(fmu: Path, outputs: tuple[str, ...], **values: float) -> str:
    """Simulate an FMU that is bound to fail for a second; return the reason and what the FMU said."""
    model = FmuModel(fmu)
    try:
        with pytest.raises(SimulationError) as failure:
            model.simulate({}, values, Experiment(1.0, 0.1, outputs))
    finally:
        model.close()
    return "\n".join((str(failure.value), *failure.value.log))
