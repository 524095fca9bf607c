"""Confirmation: a violation counts only if it recurs, also at half the step, and rtamt agrees on its sign.

A violation is simulated again on a fresh instance of the model, at the given communication step and at half
of it; both monitors evaluate each trajectory. The input signals stay the same, including their ``hold``,
which is part of the candidate; only the interval at which values are exchanged with the FMU changes. The
monitored time grid stays the same too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.experiment import Experiment
from falsifier.core.model import Model
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import FalsifierError, SimulationError, SpecError
from falsifier.evaluation.evaluate import Evaluation, check_evaluation, evaluate_any
from falsifier.fmu import FmuModel, is_solved
from falsifier.problem.problem import Problem
from falsifier.stl import second_monitor
from falsifier.stl.margins import signed

if TYPE_CHECKING:
    from falsifier import Figure

Outcome = Literal["confirmed", "fragile", "refuted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """Result of repeating the simulation of a violation, and of the second monitor.

    Attributes:
        problem: the problem whose requirement is violated.
        evaluation: the violation as found.
        outcome: ``confirmed``: it recurred, also at half the step unless that simulation fails, and both
            monitors agree on the sign;
            ``fragile``: it recurred, but not at half the step; ``refuted``: anything else.
        robustness: robustness of the fresh simulation; None if it failed.
        reference: the second monitor's robustness of the fresh simulation; None if it failed.
        reason: explanation of the outcome.
        halved: robustness at half the communication step; None if there was no such simulation or it failed.
    """

    problem: Problem
    evaluation: Evaluation
    outcome: Outcome
    robustness: float | None
    reference: float | None
    reason: str
    halved: float | None = None

    @property
    def candidate(self) -> Candidate:
        """The inputs and parameters that violate the requirement."""
        return self.evaluation.candidate

    def plot(self) -> "Figure":
        """Plot the inputs and the signals that decided the verdict, with the critical time."""
        from falsifier import plot

        return plot(self)


def confirm(problem: Problem, evaluation: Evaluation) -> Confirmation:
    """Repeat a violation on fresh instances, at the given communication step and at half of it."""
    check_evaluation(problem, evaluation)
    fresh = _repeated(problem, evaluation.candidate)
    reference, doubt = _second_opinion(problem, fresh)
    first, again = signed(evaluation.robustness), signed(fresh.robustness)
    differs = f"equal inputs give different outputs: the robustness was {first} when it was found; "
    # As far as it is shown: some solvers keep a step size from the simulation before.
    differs = "" if fresh.robustness is None or first == again else differs
    found = Confirmation(
        problem=problem,
        evaluation=evaluation,
        outcome="refuted",
        robustness=fresh.robustness,
        reference=reference,
        reason=f"{differs}the second simulation {doubt}",
    )
    if doubt:
        return found
    reason = f"{differs}a fresh simulation gives {again}, the second monitor (rtamt) {signed(reference)}"
    finer = half_step(problem)
    halved = _repeated(finer, evaluation.candidate)
    is_same = _same(fresh.trajectory, halved.trajectory)
    if not is_same:
        _, doubt = _second_opinion(finer, halved)
    outcome: Outcome = "confirmed"
    step = "largest solver step" if is_solved(problem.model) else "communication step"
    steps = f"half the {step} ({finer.experiment.step_size:.4g} s)"
    if halved.robustness is None or fresh.robustness is None:
        # No verdict either way: the violation at the given step stands, and the reason states the failure.
        reason += f"; with {steps} it {doubt}"
    elif doubt:
        outcome = "fragile" if halved.robustness >= 0 else "refuted"
        change = halved.robustness - fresh.robustness
        reason = f"{reason}, but with {steps} it {doubt}, a change of {signed(change, 4)}"
    elif is_same:
        reason += f"; its outputs do not depend on the {step}"
    else:
        reason += f"; {steps} gives {signed(halved.robustness)}"
    return replace(found, outcome=outcome, reason=reason, halved=halved.robustness)


def half_step(problem: Problem) -> Problem:
    """Return the problem with half its communication step; the monitored time grid stays the same."""
    experiment = problem.experiment
    return replace(problem, experiment=replace(experiment, step_size=experiment.step / 2))


def other_interface(problem: Problem) -> Problem:
    """Return the problem with the other interface of its FMU; SpecError if that has only one, or is none."""
    model = problem.model
    if not isinstance(model, FmuModel):
        raise SpecError(f"{problem.info.name} is not an FMU and has no second interface")
    others = [i for i in model.info.interfaces if i != model.interface]
    if not others:
        raise SpecError(f"{model.path.name} has no second interface; it only offers {model.interface}")
    return replace(problem, model=replace(model, interface=others[0]))


def _repeated(problem: Problem, candidate: Candidate) -> Evaluation:
    """Simulate on a fresh instance."""
    # The next simulation then loads the model again, so nothing left over from the search can influence it.
    problem.model.close()
    return evaluate_any(problem, candidate)


def _second_opinion(problem: Problem, again: Evaluation) -> tuple[float | None, str]:
    """Return the second monitor's robustness, and why a repetition is not a violation (empty if it is)."""
    if again.trajectory is None:
        return None, f"failed: {again.reason}"
    reference, doubt = None, ""
    try:
        reference = second_monitor.robustness(problem.requirement.formula, again.trajectory)
    except FalsifierError as error:
        doubt = f"could not be evaluated by rtamt: {error}"
    if not again.violated:
        doubt = f"does not violate: robustness {signed(again.robustness)}"
    elif reference is not None and reference >= 0:
        doubt = f"has robustness {signed(again.robustness)}, but rtamt computes {signed(reference)}"
    return reference, doubt


def _same(one: Trajectory | None, other: Trajectory | None) -> bool:
    if one is None or other is None:
        return False
    return all(np.array_equal(one[name], other[name]) for name in one.names)


@dataclass(frozen=True, slots=True)
class Movement:
    """How much one output changes if the communication step is halved."""

    largest: float  # maximum distance between the two trajectories, in the output's unit
    time: float  # time in s at which it occurs
    span: float  # maximum minus minimum of the finer trajectory, in the output's unit

    @property
    def relative(self) -> float:
        """Maximum distance as a share of the span; 0 for an output that is constant in both trajectories."""
        if self.span > 0.0:
            return self.largest / self.span
        return 0.0 if self.largest == 0.0 else float("inf")


def step_convergence(
    model: Model, experiment: Experiment, signals: Mapping[str, Signal]
) -> dict[str, Movement]:
    """Return how much each output changes with half the step, by name; SimulationError if one fails."""
    coarse = model.simulate(signals, {}, experiment)
    try:
        fine = model.simulate(signals, {}, replace(experiment, step_size=experiment.step / 2))
    except SimulationError as error:
        why = f"the step of {experiment.step:g} s works, but cannot be compared with half of it: {error}"
        raise SimulationError(why, status=error.status, time=error.time, log=error.log) from None
    moved = {}
    for name in coarse.names:
        distance = np.abs(fine[name] - coarse[name])
        k = int(distance.argmax())
        moved[name] = Movement(float(distance[k]), float(coarse.times[k]), float(np.ptp(fine[name])))
    return moved


def sufficient_step(
    model: Model, experiment: Experiment, signals: Mapping[str, Signal], *, share: float, halvings: int
) -> float | None:
    """Return the largest step in s at which halving changes no output by more than a share of its range.

    The experiment has the step to begin with, which is halved so many times at most.

    Returns:
        The step, which is the first one or a half, a quarter, ... of it; None if none of these is enough.

    Raises:
        SimulationError: if a simulation fails.
    """
    step = experiment.step
    for _ in range(halvings + 1):
        moved = step_convergence(model, replace(experiment, step_size=step), signals)
        if all(each.relative <= share for each in moved.values()):
            return step
        step /= 2
    return None
