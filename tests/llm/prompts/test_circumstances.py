from dataclasses import replace

from falsifier.evaluation.confirm import Confirmation, Outcome
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.circumstances import in_doubt
from falsifier.stl import Verdict
from falsifier.testing import lag_problem

PROBLEM = lag_problem()
FOUND = Evaluation(PROBLEM.space.decode([0.0] * 4), verdict=Verdict(-0.001, 1.0, "x <= 0.9"))


def doubtful(outcome: Outcome, robustness: float | None, reference: float | None) -> Confirmation:
    return Confirmation(
        problem=PROBLEM,
        evaluation=FOUND,
        outcome=outcome,
        robustness=robustness,
        reference=reference,
        reason="the FMU's own words",
    )


def test_a_fragile_violation_tells_how_far_below_zero_counts() -> None:
    told = in_doubt(replace(doubtful("fragile", -0.001, -0.001), halved=0.004))
    assert "does not count as a violation, it is fragile" in told
    assert "half the simulation step its robustness is +0.004" in told
    assert "below 0 by more than 0.005" in told


def test_a_refuted_violation_tells_what_refuted_it() -> None:
    again = in_doubt(doubtful("refuted", 0.002, None))
    assert "refuted: a second simulation gave robustness +0.002" in again and "more than 0.003" in again
    other = in_doubt(doubtful("refuted", -0.001, 0.5))
    assert "second monitor does not confirm it, +0.5 instead of -0.001" in other
    failed = in_doubt(doubtful("refuted", None, None))
    assert "second simulation of it failed" in failed
    assert not any("FMU" in text for text in (again, other, failed)), "words of the model may contain names"
