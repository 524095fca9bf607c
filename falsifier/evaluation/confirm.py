"""Second opinions: a violation counts only when it happens again, at a finer step too, and rtamt agrees.

A violation is simulated on a fresh instance of the model at the given communication step and at half of it;
each trajectory is judged by both monitors. The held input signals stay the same: ``hold`` belongs to the
candidate, only how often the simulator exchanges values changes. The monitored time grid stays the same too.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.errors import FalsifierError, SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem

if TYPE_CHECKING:
    from falsifier import Figure

Outcome = Literal["confirmed", "fragile", "refuted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """What second simulations and the second monitor said of a violation.

    Attributes:
        problem: what it violates.
        evaluation: the violation as found.
        outcome: ``confirmed``: it happened again, at half the step too, and both monitors agree on the sign;
            ``fragile``: it happened again, but not at half the step; ``refuted``: anything else.
        robustness: of the fresh simulation, None when it failed.
        reference: the second monitor's robustness of the fresh simulation, None when it gave none.
        reason: in words.
        halved: robustness at half the communication step, None when there was no such simulation.
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
        """The inputs and parameters that violate."""
        return self.evaluation.candidate

    def plot(self) -> "Figure":
        """Picture of the inputs and of the signals that decided, with the critical time."""
        from falsifier import plot

        return plot(self)


@dataclass(frozen=True, slots=True)
class _Opinion:
    """One repetition: what both monitors say of it, and what speaks against it as a violation."""

    trajectory: Trajectory | None
    robustness: float | None
    reference: float | None
    doubt: str


def confirm(problem: Problem, evaluation: Evaluation) -> Confirmation:
    """Simulate a violation again on fresh instances, at the given and at half the communication step."""
    fresh = _repeat(problem, evaluation.candidate)
    if fresh.doubt:
        reason = f"the second simulation {fresh.doubt}"
        return Confirmation(
            problem=problem,
            evaluation=evaluation,
            outcome="refuted",
            robustness=fresh.robustness,
            reference=fresh.reference,
            reason=reason,
        )
    reason = f"a fresh simulation gives {fresh.robustness:+.6g}, rtamt {fresh.reference:+.6g}"
    finer = half_step(problem)
    halved = _repeat(finer, evaluation.candidate, known=fresh)
    outcome: Outcome = "confirmed"
    steps = f"half the communication step ({finer.experiment.step_size:.4g} s)"
    if halved.robustness is None or fresh.robustness is None:
        reason += f"; {steps} could not be judged: it {halved.doubt}"
    elif halved.doubt:
        outcome = "fragile" if halved.robustness >= 0 else "refuted"
        change = halved.robustness - fresh.robustness
        reason = f"{reason}, but {steps} {halved.doubt}, a change of {change:+.4g}"
    elif _same(fresh.trajectory, halved.trajectory):
        reason += "; its outputs do not depend on the communication step"
    else:
        reason += f"; {steps} gives {halved.robustness:+.6g}"
    return Confirmation(
        problem=problem,
        evaluation=evaluation,
        outcome=outcome,
        robustness=fresh.robustness,
        reference=fresh.reference,
        reason=reason,
        halved=halved.robustness,
    )


def half_step(problem: Problem) -> Problem:
    """Return the problem simulated with half its communication step; the monitored grid stays the same."""
    experiment = problem.experiment
    step = (experiment.step_size or experiment.output_interval) / 2
    return replace(problem, experiment=replace(experiment, step_size=step))


def other_interface(problem: Problem) -> Problem:
    """Return the problem with its FMU simulated through the other interface.

    Raises:
        SpecError: when the model is no FMU or has one interface only.
    """
    from falsifier.fmu import FmuModel

    model = problem.model
    if not isinstance(model, FmuModel):
        raise SpecError(f"{problem.info.name} is not an FMU: it has no second interface")
    others = [i for i in model.info.interfaces if i != model.interface]
    if not others:
        raise SpecError(f"{model.path.name} offers {model.interface} only: there is no second interface")
    return replace(problem, model=replace(model, interface=others[0]))


def _repeat(problem: Problem, candidate: Candidate, *, known: _Opinion | None = None) -> _Opinion:
    """Simulate on a fresh instance; where the outputs are those of a known opinion, so is the judgement."""
    problem.model.close()
    again = evaluate(problem, candidate)
    if again.trajectory is None or again.robustness is None:
        return _Opinion(None, None, None, f"gave no verdict: {again.reason}")
    if known is not None and _same(known.trajectory, again.trajectory):
        return known
    reference, doubt = _second_monitor(problem, again.trajectory)
    if not again.violated:
        doubt = f"does not violate: robustness {again.robustness:+.6g}"
    elif reference is not None and reference >= 0:
        doubt = f"divides the monitors: {again.robustness:+.6g} here, {reference:+.6g} by rtamt"
    return _Opinion(again.trajectory, again.robustness, reference, doubt)


def _second_monitor(problem: Problem, trajectory: Trajectory) -> tuple[float | None, str]:
    from falsifier.stl import reference

    try:
        return reference.robustness(problem.requirement.formula, trajectory), ""
    except FalsifierError as error:
        return None, f"could not be judged by rtamt: {error}"


def _same(one: Trajectory | None, other: Trajectory | None) -> bool:
    return (
        one is not None
        and other is not None
        and all(np.array_equal(one[name], other[name]) for name in one.names)
    )
