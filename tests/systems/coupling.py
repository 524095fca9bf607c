"""Bundled systems of FMUs beside the single FMU of the same system."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.problem.loading import load_problems
from falsifier.problem.problem import Problem, alike


def problems(system: str) -> list[Problem]:
    """The problems of a system, which all record the same signals."""
    (group,) = alike(load_problems(system))
    return group


def owned(candidate: Candidate, component: str) -> Candidate:
    """The same signals and parameters as those of one component."""
    signals = {f"{component}.{name}": signal for name, signal in candidate.signals.items()}
    return Candidate(signals, {f"{component}.{name}": v for name, v in candidate.parameters.items()})


def simulated(
    problem: Problem, candidate: Candidate, *, step: float | None = None, stop: float | None = None
) -> Trajectory:
    """The trajectory with this communication step and stop time in s; None: the problem's."""
    given = problem.experiment
    experiment = replace(given, step_size=step or given.step_size, stop_time=stop or given.stop_time)
    parameters = {**problem.parameters, **candidate.parameters}
    return problem.model.simulate(candidate.signals, parameters, experiment)


def distances(one: Trajectory, several: Trajectory, names: Mapping[str, str]) -> dict[str, float]:
    """Largest difference of signals, which have other names in the system of several FMUs."""
    return {name: float(np.abs(one[name] - several[other]).max()) for name, other in names.items()}
