"""What all simulations of one search have in common, checked once, and the numbers in which they differ."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal, constant_pieces
from falsifier.errors import ModelError, SimulationError, did_you_mean
from falsifier.fmu.description.model_description import Description

_DEFAULT_TIME_LIMIT = 60.0
# Without a limit of the user, each of so many shares of the simulated time may take as long as that.
SHARES = 10
# Numbers at the start of the memory; their positions are those of ``enum header`` in worker.h.
HEADER = 8


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """What all simulations of a search have in common."""

    model: str  # name of the FMU or system
    experiment: Experiment  # its outputs are in the order of their rows
    inputs: tuple[str, ...]  # names of the inputs that are set, in the order of their rows
    parameters: tuple[str, ...]  # names of the parameters and start values that are set
    units: Mapping[str, str]  # units of the outputs by name
    # Smallest and largest number of the types of inputs and parameters, by name; not of reals.
    limits: Mapping[str, tuple[float, float]]
    times: NDArray[np.float64]  # the output grid in s, made once
    every: int  # communication steps per output interval (co-simulation)
    pieces: int  # maximum number of pieces of an input, see ``Signal.pieces``

    @property
    def time_limit(self) -> float:
        """Maximum wall-clock time in s of one simulation, or of a share of it."""
        return self.experiment.time_limit or _DEFAULT_TIME_LIMIT

    @property
    def shares(self) -> int:
        """How many shares of the simulated time may each take so long; 0 if the user limits the whole.

        So slow models are simulated, and those that hang are ended.
        """
        return SHARES if self.experiment.time_limit is None else 0

    @property
    def names(self) -> frozenset[str]:
        """Names of all variables that a simulation sets."""
        return frozenset((*self.inputs, *self.parameters, *(name for name, _ in self.experiment.strings)))

    @property
    def given(self) -> int:
        """How many numbers a simulation is given; see ``given_values``."""
        return len(self.parameters) + len(self.inputs) * 5 * self.pieces


def make_plan(
    description: Description,
    experiment: Experiment,
    inputs: Iterable[str],
    parameters: Iterable[str],
    *,
    pieces: int = 1,
) -> Plan:
    """Look up and check what the simulations of a search have in common.

    Raises:
        ModelError: naming a variable that the model does not have or that cannot be set or recorded.
    """
    model = description.info.name
    variables = {v.name: v for v in description.info.variables}
    inputs, parameters = tuple(inputs), tuple(parameters)
    for name in (*inputs, *parameters, *experiment.outputs):
        description.slot(name)
    for name in inputs:
        if (role := variables[name].causality) != "input":
            known = ", ".join(v.name for v in description.info.inputs) or "none"
            raise ModelError(
                f"{model}: {name!r} is not an input, its causality is {role}; the inputs are: {known}"
            )
    for name in parameters:
        if refusal := variables[name].refusal:
            raise ModelError(f"{model}: {name!r} cannot be set: {refusal}")
    for name, _ in experiment.strings:
        slot = description.slots.get(name)
        if slot is None:
            raise ModelError(f"{model}: no variable {name!r}; {did_you_mean(name, description.slots)}")
        refusal = variables[name].refusal
        if refusal or slot.type != "String" or slot.size != 1:
            reason = refusal or "it is not a single string"
            raise ModelError(f"{model}: {name!r} cannot be set to a text: {reason}")
    return Plan(
        model=model,
        experiment=experiment,
        inputs=inputs,
        parameters=parameters,
        units={name: variables[name].unit for name in experiment.outputs if variables[name].unit},
        limits={n: limits for n in (*inputs, *parameters) if (limits := variables[n].type_limits)},
        times=experiment.times,
        every=round(experiment.output_interval / experiment.step),
        pieces=pieces,
    )


def held_pieces(signal: Signal, times: NDArray[np.float64], *, whole: bool) -> NDArray[np.float64]:
    """Return constant pieces that start at the sample times at which the signal changes."""
    values = signal.sample(times)
    values = np.rint(values) if whole else values
    changes = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    return constant_pieces(times[changes], values[changes])


def given_values(
    plan: Plan, inputs: Mapping[str, NDArray[np.float64]], parameters: Mapping[str, float]
) -> NDArray[np.float64]:
    """Return what one simulation is given: parameters, then the rows of the inputs; shape (plan.given,).

    The inputs are piecewise cubics (``Signal.pieces``); unused pieces of a row start at inf.

    Raises:
        SimulationError: if values do not fit a variable; names the variable and the range of its type.
    """
    given = np.full(plan.given, np.inf)
    given[: len(parameters)] = list(parameters.values())
    for row, table in zip(
        given[len(parameters) :].reshape(len(inputs), 5 * plan.pieces), inputs.values(), strict=True
    ):
        row[: table.size] = table.ravel()
    for name, (low, high) in plan.limits.items():
        # Interpolated values are always between those at the ends of a piece.
        values = inputs[name][:, 1] if name in inputs else np.array([parameters[name]])
        if not (low - 0.5 <= values.min() and values.max() <= high + 0.5):
            raise SimulationError(
                f"{plan.model}: values from {values.min():.10g} to {values.max():.10g} do not fit {name!r}, "
                f"whose type ranges from {low:.16g} to {high:.16g}",
                time=0.0,
            )
    return given
