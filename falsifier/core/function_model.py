"""Python functions as models."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import instance
from falsifier.core.experiment import Experiment
from falsifier.core.model import ModelInfo, check_finite
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ModelError, SimulationError, did_you_mean


@dataclass(frozen=True, slots=True)
class FunctionModel:
    """A Python function as a model, for tutorials and tests.

    Attributes:
        function: called as ``function(times, inputs, parameters)`` with the time grid, shape (n,), read-only,
            all inputs of ``info`` by name, sampled or constant, shape (n,) each, and the parameter values by
            name; returns one array of shape (n,) per output name. It must be importable (no lambda) if it is
            to run in other processes.
        info: name, description and variables; inputs, parameters and outputs must be listed.

    Raises:
        ModelError: if an input and an output have the same name.
    """

    function: Callable[
        [NDArray[np.float64], dict[str, NDArray[np.float64]], dict[str, float]],
        Mapping[str, NDArray[np.float64]],
    ]
    info: ModelInfo

    def __post_init__(self) -> None:
        instance("function", self.function, Callable, "a function")
        instance("info", self.info, ModelInfo, "a ModelInfo")
        inputs = {v.name for v in self.info.inputs}
        if both := next((v.name for v in self.info.outputs if v.name in inputs), None):
            raise ModelError(f"{self.info.name}: {both!r} is an input and an output; rename one of them")

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Call the function once with all inputs sampled on the experiment's time grid.

        Inputs without a signal have the value in ``parameters``, otherwise their start value, otherwise 0.

        Raises:
            SimulationError: if the function raises an exception, omits an output, or returns an array of the
                wrong shape or a value that is not finite.
        """
        who, times = self.info.name, experiment.times
        constant = {v.name: parameters.get(v.name, v.start_number or 0.0) for v in self.info.inputs}
        inputs = {name: np.full(times.shape, value, dtype=np.float64) for name, value in constant.items()}
        inputs |= {name: signal.sample(times) for name, signal in signals.items()}
        others = {name: value for name, value in parameters.items() if name not in inputs}
        try:
            outputs = self.function(times, inputs, others)
        except (Exception, SystemExit) as error:
            raise SimulationError(f"{who}: {type(error).__name__}: {error}") from error
        if not isinstance(outputs, Mapping):
            raise SimulationError(
                f"{who}: the function returned {type(outputs).__name__}; expected a dictionary by output name"
            )
        columns: dict[str, NDArray[np.float64]] = {}
        for name in experiment.outputs:
            if name not in outputs:
                raise SimulationError(
                    f"{who}: the function did not return the output {name!r}; {did_you_mean(name, outputs)}"
                )
            try:
                columns[name] = np.array(outputs[name]).astype(np.float64, casting="same_kind")
            except (TypeError, ValueError):
                raise SimulationError(f"{who}: output {name!r} is not an array of real numbers") from None
            if columns[name].shape != times.shape:
                raise SimulationError(
                    f"{who}: output {name!r} has shape {columns[name].shape}, expected {times.shape}"
                )
        check_finite(who, times, columns)
        return Trajectory(times, columns, {v.name: v.unit for v in self.info.outputs if v.unit})

    def close(self) -> None:
        """Nothing to release: a function opens no processes or files."""
