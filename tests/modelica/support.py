"""Drives FMUs for the tests: co-simulation through fmpy, model exchange by a small integrator."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from falsifier.core.model import Experiment
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel

Floats = npt.NDArray[np.float64]
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
def opened(path: Path, count: int = 1, *, exchange: bool = False) -> Iterator[list[Instance]]:
    """Instances of one FMU in this process."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Model, FMU2Slave

    description = read_model_description(str(path), validate=True)
    interface = description.modelExchange if exchange else description.coSimulation
    folder = extract(str(path))
    made = []
    for k in range(count):
        fmu = (FMU2Model if exchange else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName=f"instance {k}",
        )
        fmu.instantiate()
        made.append(Instance(fmu, description))
    yield made
    for instance in made:  # fmpy's freeInstance closes the library as well, so only the last one may use it
        instance.fmu.fmi2FreeInstance(instance.fmu.component)
    shutil.rmtree(folder, ignore_errors=True)


_A = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
_B = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
_C = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0)


class Exchange:
    """Integrates a model-exchange FMU with fixed steps; inputs are evaluated at the stage times."""

    def __init__(self, instance: Instance, inputs: Inputs | None = None) -> None:
        self.instance = instance
        self.inputs = inputs or (lambda _: {})
        self.events = 0
        self.next_time = np.inf
        states = [v for v in instance.variables.values() if v.derivative is not None]
        self.size = len(states)

    def start(self, **values: float) -> Exchange:
        self.instance.start(**{**self.inputs(0.0), **values})
        self.handle_events()
        return self

    def handle_events(self) -> None:
        again = True
        while again:
            again, terminate, _, _, defined, next_time = self.instance.fmu.newDiscreteStates()
            assert not terminate
            self.next_time = next_time if defined else np.inf
        self.instance.fmu.enterContinuousTimeMode()

    def states(self) -> Floats:
        x = (self.ctypes_double * self.size)()
        self.instance.fmu.getContinuousStates(x, self.size)
        return np.array(x)

    @property
    def ctypes_double(self) -> Any:
        import ctypes

        return ctypes.c_double

    def put(self, time: float, x: Floats) -> None:
        self.instance.fmu.setTime(time)
        self.instance.set(self.inputs(time))
        self.instance.fmu.setContinuousStates((self.ctypes_double * self.size)(*x), self.size)

    def slope(self, time: float, x: Floats) -> Floats:
        self.put(time, x)
        dx = (self.ctypes_double * self.size)()
        self.instance.fmu.getDerivatives(dx, self.size)
        return np.array(dx)

    def stepped(self, time: float, x: Floats, h: float) -> Floats:
        """The states after one step of the Dormand-Prince method of order 5."""
        k: list[Floats] = []
        for a, c in zip(_A, _C, strict=True):
            k.append(
                self.slope(
                    time + c * h, x + h * sum((w * s for w, s in zip(a, k, strict=True)), np.zeros(self.size))
                )
            )
        return x + h * sum((w * s for w, s in zip(_B, k, strict=True)), np.zeros(self.size))

    def crossed(self, time: float, x: Floats) -> bool:
        self.put(time, x)
        enter, terminate = self.instance.fmu.completedIntegratorStep()
        assert not terminate
        return bool(enter)

    def advance(self, time: float, stop: float) -> None:
        """From one instant to a later one, with every event on the way located by bisection."""
        while stop - time > 1e-10:
            target = min(stop, self.next_time)
            x, h = self.states(), target - time
            if h > 0:
                end = self.stepped(time, x, h)
                if self.crossed(target, end):
                    low, high = 0.0, h
                    while high - low > 1e-12:
                        middle = 0.5 * (low + high)
                        low, high = (
                            (low, middle)
                            if self.crossed(time + middle, self.stepped(time, x, middle))
                            else (middle, high)
                        )
                    end, target = self.stepped(time, x, high), time + high
                    self.put(target, end)
                    self.event()
                    time = target
                    continue
                self.put(target, end)
            if self.next_time - target < 1e-10:
                self.event()
            time = target

    def event(self) -> None:
        self.events += 1
        self.instance.fmu.enterEventMode()
        self.handle_events()

    def run(self, names: Sequence[str], stop: float, size: float) -> Floats:
        rows = [[0.0, *self.instance.row(names)]]
        for k in range(round(stop / size)):
            self.advance(k * size, (k + 1) * size)
            rows.append([(k + 1) * size, *self.instance.row(names)])
        return np.array(rows)


def said_on_failure(fmu: Path, outputs: tuple[str, ...], **values: float) -> str:
    """Simulate an FMU that is bound to fail for a second; return the reason and what the FMU said."""
    model = FmuModel(fmu)
    try:
        with pytest.raises(SimulationError) as failure:
            model.simulate({}, values, Experiment(1.0, 0.1, outputs))
    finally:
        model.close()
    return "\n".join((str(failure.value), *failure.value.log))
