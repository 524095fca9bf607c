"""Second opinions: a violation counts only when it happens again and another monitor agrees."""

from dataclasses import dataclass
from typing import Literal

from falsifier.evaluation import Evaluation, evaluate
from falsifier.problem import Problem

Outcome = Literal["confirmed", "refuted"]


@dataclass(frozen=True, slots=True)
class Confirmation:
    """What the second simulation and the second monitor said of a violation.

    Attributes:
        evaluation: the violation as found.
        outcome: ``confirmed`` when the fresh simulation violates too and both monitors agree on the sign.
        robustness: of the fresh simulation, None when it failed.
        reference: the second monitor's robustness of the fresh simulation.
        reason: in words.
    """

    evaluation: Evaluation
    outcome: Outcome
    robustness: float | None
    reference: float | None
    reason: str


def confirm(problem: Problem, evaluation: Evaluation) -> Confirmation:
    """Simulate a violation on a fresh instance of the model and have it judged by rtamt as well."""
    from falsifier.stl import reference

    problem.model.close()
    again = evaluate(problem, evaluation.candidate)
    if again.trajectory is None or again.robustness is None:
        return Confirmation(
            evaluation, "refuted", None, None, f"the second simulation gave no verdict: {again.reason}"
        )
    second = reference.robustness(problem.requirement.formula, again.trajectory)
    if not again.violated:
        reason = f"the second simulation does not violate: robustness {again.robustness:+.6g}"
        return Confirmation(evaluation, "refuted", again.robustness, second, reason)
    if second >= 0:
        reason = f"the monitors disagree: {again.robustness:+.6g} here, {second:+.6g} by rtamt"
        return Confirmation(evaluation, "refuted", again.robustness, second, reason)
    reason = f"a fresh simulation gives {again.robustness:+.6g}, rtamt {second:+.6g}"
    return Confirmation(evaluation, "confirmed", again.robustness, second, reason)
