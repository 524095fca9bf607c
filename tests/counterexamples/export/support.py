"""Counterexamples of the transmission, exported."""

from pathlib import Path

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.store import to_store
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

AT_INPUTS = {
    "held": Candidate(
        {
            "throttle": Signal.evenly((90, 20, 100, 60, 95, 3, 80), stop_time=50.0),
            "brake": Signal.evenly((0, 200, 10), stop_time=50.0),
        }
    ),
    "steps between communication points": Candidate(
        {
            "throttle": Signal((0.0, 1.2345678, 20.0), (100.0, 35.0, 80.0), "constant"),
            "brake": Signal((0.0, 7.77), (0.0, 250.0), "constant"),
        }
    ),
    "constant": Candidate({"throttle": Signal((0.0,), (100.0,)), "brake": Signal((0.0,), (0.0,))}),
}


def confirmed(problem: Problem, evaluation: Evaluation) -> Confirmation:
    return Confirmation(
        problem=problem,
        evaluation=evaluation,
        outcome="confirmed",
        robustness=evaluation.robustness,
        reference=evaluation.robustness,
        reason="",
    )


def exported(problem: Problem, evaluation: Evaluation, directory: Path) -> list[Path]:
    stored = to_store(confirmed(problem, evaluation))
    return export_counterexample(problem, stored, evaluation, directory)
