"""Input signals as a table, exactly as they were applied in the simulation."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Variable
from falsifier.core.signals import Signal
from falsifier.problem.problem import Problem


@dataclass(frozen=True, slots=True)
class InputTable:
    """Input signals over time, linear between two rows.

    Attributes:
        times: in s, shape (n,), from 0 to the stop time; a repeated time is a step.
        columns: one array of shape (n,) per input, by name.
    """

    times: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]


def input_table(problem: Problem, candidate: Candidate) -> InputTable:
    """Make a table of all numeric inputs of the model, including constant ones.

    The rows are the communication points, at which inputs are set. Held and piecewise constant signals step
    there: one row with the value before and one with the value after. Redundant rows are omitted.
    """
    experiment = problem.experiment
    steps = round(experiment.stop_time / (experiment.step_size or experiment.output_interval))
    times = np.arange(steps + 1, dtype=np.float64) * np.float64(experiment.stop_time / steps)
    after, before = {}, {}
    for variable in problem.info.inputs:
        values = _values(problem, candidate, variable, times)
        if values is not None:
            name = variable.name
            after[name] = values
            stepped = name in candidate.signals and _steps(variable, candidate.signals[name])
            before[name] = np.concatenate((values[:1], values[:-1])) if stepped else values
    rows = [
        pair
        for k in range(steps + 1)
        for pair in ((k, False), (k, True))
        if pair[1] or any(before[n][k] != after[n][k] for n in after)
    ]
    # A step at the stop time has no effect: the last inputs are set one communication step earlier.
    rows = rows[:-1] if len(rows) > 1 and rows[-2] == (steps, False) else rows
    columns = {n: np.array([(after if late else before)[n][k] for k, late in rows]) for n in after}
    return _without_repetition(InputTable(times[[k for k, _ in rows]], columns))


def start_values(problem: Problem, candidate: Candidate) -> dict[str, float | str]:
    """Parameters, strings and start values that differ from the model's own, by name."""
    inputs = {v.name for v in problem.info.inputs}
    settings: dict[str, float | str] = {**problem.parameters, **candidate.parameters}
    settings |= dict(problem.experiment.strings)
    return {name: value for name, value in settings.items() if name not in inputs}


def _values(
    problem: Problem, candidate: Candidate, variable: Variable, times: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    if variable.name in candidate.signals:
        values = candidate.signals[variable.name].sample(times)
        return values if variable.kind == "real" else np.rint(values)
    value = problem.parameters.get(variable.name, variable.start)
    return np.full(times.shape, float(value)) if isinstance(value, int | float) else None


def _steps(variable: Variable, signal: Signal) -> bool:
    return signal.hold is not None or signal.interpolation == "constant" or variable.kind != "real"


def _without_repetition(table: InputTable) -> InputTable:
    """Return the table without rows that lie between two equal ones; steps stay."""
    values = np.stack(list(table.columns.values())) if table.columns else np.zeros((1, len(table.times)))
    inner = (values[:, 1:-1] == values[:, :-2]).all(axis=0) & (values[:, 1:-1] == values[:, 2:]).all(axis=0)
    kept = np.concatenate(([True], ~inner, [True])) if len(table.times) > 1 else np.array([True])
    return InputTable(table.times[kept], {name: column[kept] for name, column in table.columns.items()})
