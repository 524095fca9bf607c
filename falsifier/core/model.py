"""What simulates: the Model protocol, what is known of a model, and Python functions as models."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SimulationError, did_you_mean

Kind = Literal["real", "integer", "boolean", "enumeration", "string"]
Causality = Literal["input", "output", "parameter", "calculatedParameter", "local", "independent"]
Interface = Literal["co-simulation", "model-exchange"]

# Smallest and largest number by type name: FMI 1 and 2 have 32-bit Integers.
_TYPE_LIMITS: Mapping[str, tuple[int, int]] = {
    "Boolean": (0, 1),
    "Integer": (-(2**31), 2**31 - 1),
    **{f"Int{b}": (-(2 ** (b - 1)), 2 ** (b - 1) - 1) for b in (8, 16, 32, 64)},
    **{f"UInt{b}": (0, 2**b - 1) for b in (8, 16, 32, 64)},
}


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar variable of a model; elements of arrays are variables of their own (``x[1]``).

    Attributes:
        name: as formulas and spec files name it.
        kind: type of its values.
        causality: role in the model.
        variability: ``constant``, ``fixed``, ``tunable``, ``discrete`` or ``continuous``.
        unit: unit of all numbers here, empty where unknown.
        display_unit: unit for people, empty where none is given.
        low: smallest value, None where unbounded.
        high: largest value.
        nominal: typical magnitude.
        start: start value.
        settable: whether it can be set before the simulation starts.
        is_state: whether it is a continuous state.
        literals: names of an enumeration's values with their numbers.
        description: what it means.
        type: name of the type that holds its values, such as ``Int8``; empty where unknown.
    """

    name: str
    kind: Kind = "real"
    causality: Causality = "local"
    variability: str = "continuous"
    unit: str = ""
    display_unit: str = ""
    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    start: float | str | None = None
    settable: bool = False
    is_state: bool = False
    literals: Mapping[str, int] = field(default_factory=dict)
    description: str = ""
    type: str = ""

    @property
    def type_limits(self) -> tuple[int, int] | None:
        """Smallest and largest number that its type holds; None for reals."""
        return _TYPE_LIMITS.get(self.type)

    @property
    def limits(self) -> tuple[float | None, float | None]:
        """Declared min and max; where none is declared, those of Booleans and of an enumeration's items."""
        numbers = (0, 1) if self.kind == "boolean" else tuple(self.literals.values())
        low = min(numbers, default=None) if self.low is None else self.low
        high = max(numbers, default=None) if self.high is None else self.high
        return low, high


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """What is known of a model without simulating it.

    Attributes:
        name: the model's name.
        description: what the system is, in a sentence or two.
        fmi_version: ``1.0``, ``2.0``, ``3.0``; empty for models that are not FMUs.
        interfaces: how it can be simulated.
        platforms: names of the platforms that it carries binaries for.
        tool: what generated it.
        stop_time: of its default experiment in s, where given.
        step_size: of its default experiment in s, where given.
        tolerance: relative tolerance of its default experiment, where given.
        variables: all scalar variables.
        clocks: names of the clocks that a simulator would have to tick (FMI 3).
    """

    name: str
    description: str = ""
    fmi_version: str = ""
    interfaces: tuple[Interface, ...] = ()
    platforms: tuple[str, ...] = ()
    tool: str = ""
    stop_time: float | None = None
    step_size: float | None = None
    tolerance: float | None = None
    variables: tuple[Variable, ...] = ()
    clocks: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Variable:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(f"no variable {name!r}; {did_you_mean(name, (v.name for v in self.variables))}")

    def __contains__(self, name: object) -> bool:
        return any(v.name == name for v in self.variables)

    def with_causality(self, causality: Causality) -> tuple[Variable, ...]:
        """Variables of one role, in the model's order."""
        return tuple(v for v in self.variables if v.causality == causality)

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """Input variables in the model's order."""
        return self.with_causality("input")

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """Output variables in the model's order."""
        return self.with_causality("output")

    @property
    def parameters(self) -> tuple[Variable, ...]:
        """Parameters in the model's order."""
        return self.with_causality("parameter")


@dataclass(frozen=True, slots=True)
class Experiment:
    """How one simulation is run; the same for all candidates of a problem.

    Attributes:
        stop_time: end in s; simulations start at 0.
        output_interval: step of the trajectory's grid in s; stop_time is a whole multiple of it.
        outputs: names of the variables to record.
        step_size: communication step (co-simulation) or largest solver step (model exchange) in s; None: the
            output interval.
        tolerance: relative tolerance handed to the model or used by the solver; None: the model's own.
        time_limit: wall-clock seconds for one simulation.
    """

    stop_time: float
    output_interval: float
    outputs: tuple[str, ...]
    step_size: float | None = None
    tolerance: float | None = None
    time_limit: float = 60.0

    @property
    def samples(self) -> int:
        """Number of samples of the trajectory, both ends included."""
        return round(self.stop_time / self.output_interval) + 1

    @property
    def times(self) -> NDArray[np.float64]:
        """The trajectory's time grid in s, shape (samples,)."""
        return np.linspace(0.0, self.stop_time, self.samples)


class Model(Protocol):
    """Something that simulates. Models are picklable descriptions; what they load stays in the process."""

    @property
    def info(self) -> ModelInfo:
        """What is known of the model without simulating it."""
        ...

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Simulate once from time 0 and return the outputs on the experiment's time grid.

        Args:
            signals: an input signal for each driven input, by name; other inputs keep their start values.
            parameters: values of parameters and of start values, by name.
            experiment: times, outputs and limits.

        Raises:
            SimulationError: when there is no full trajectory of finite numbers, with the reason.
            ModelError: when the model cannot be used at all.
        """
        ...

    def close(self) -> None:
        """Release processes, libraries and folders; a later simulation opens them again."""
        ...


@dataclass(frozen=True, slots=True)
class FunctionModel:
    """A Python function as a model, for tutorials and tests.

    Attributes:
        function: called as ``function(times, inputs, parameters)`` with the time grid, shape (n,), the
            sampled inputs by name, shape (n,) each, and the parameter values by name; returns one array of
            shape (n,) per output name. It must be importable (no lambda) where problems travel between
            processes.
        info: name, description and variables; inputs, parameters and outputs must be listed.
    """

    function: Callable[
        [NDArray[np.float64], dict[str, NDArray[np.float64]], dict[str, float]],
        Mapping[str, NDArray[np.float64]],
    ]
    info: ModelInfo

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Call the function once; see Model.simulate."""
        times = experiment.times
        inputs = {name: signal.sample(times) for name, signal in signals.items()}
        try:
            outputs = self.function(times, inputs, dict(parameters))
        except Exception as error:
            raise SimulationError(f"{self.info.name}: {type(error).__name__}: {error}") from error
        columns: dict[str, NDArray[np.float64]] = {}
        for name in experiment.outputs:
            if name not in outputs:
                raise SimulationError(
                    f"{self.info.name}: the function returned no output {name!r}; "
                    f"{did_you_mean(name, outputs)}"
                )
            columns[name] = np.array(outputs[name], dtype=np.float64)
            if columns[name].shape != times.shape:
                raise SimulationError(
                    f"{self.info.name}: output {name!r} has shape {columns[name].shape}, "
                    f"expected {times.shape}"
                )
        check_finite(self.info.name, times, columns)
        return Trajectory(times, columns, {v.name: v.unit for v in self.info.outputs if v.unit})

    def close(self) -> None:
        """Do nothing: a function holds nothing open."""


def check_finite(model: str, times: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Refuse NaN and inf in outputs.

    Raises:
        SimulationError: naming the signal and the first time at which it is not finite.
    """
    for name, column in columns.items():
        finite = np.isfinite(column)
        if not finite.all():
            k = int(np.argmin(finite))
            raise SimulationError(
                f"{model}: output {name!r} is {column[k]} at t = {times[k]:g} s", time=float(times[k])
            )
