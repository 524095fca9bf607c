"""Where a system starts: its outputs at time 0, for which no simulation is spent."""

from dataclasses import replace
from math import ceil

from falsifier.core.model import GRID_ROUNDING
from falsifier.errors import CandidateError, ModelError, SimulationError
from falsifier.fmu import System
from falsifier.problem.problem import Problem


def start_values(problem: Problem) -> dict[str, tuple[float, float]]:
    """Initialise the model at both ends of the search space, and read the outputs at time 0.

    The model takes one output step at most, a system as many as its slowest component needs for one. What
    cannot be initialised is left out: the search itself reports such failures.

    Returns:
        The smaller and the larger value by output name; empty if the model could not be initialised.
    """
    space, experiment = problem.space, problem.experiment
    brief = replace(experiment, stop_time=_shortest(problem))
    found: list[dict[str, float]] = []
    for corner in ([d.low for d in space.dimensions], [d.high for d in space.dimensions]):
        try:
            candidate = space.decode(corner)
            outputs = problem.model.simulate(
                candidate.signals, {**problem.parameters, **candidate.parameters}, brief
            )
        except (CandidateError, ModelError, SimulationError):
            continue
        found.append(outputs.at(0.0))
    if not found:
        return {}
    return {
        name: (min(values[name] for values in found), max(values[name] for values in found))
        for name in experiment.outputs
        if name in found[0]
    }


def _shortest(problem: Problem) -> float:
    """Return the shortest simulation in s in which every component steps."""
    interval, model = problem.experiment.output_interval, problem.model
    steps = [part.step or 0.0 for part in model.parts.values()] if isinstance(model, System) else []
    return interval * max(1, ceil(max(steps, default=0.0) / interval * (1.0 - GRID_ROUNDING)))
