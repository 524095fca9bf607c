"""Counterexamples as files that people and other tools read."""

import json
from pathlib import Path

from falsifier.confirm import Confirmation
from falsifier.problem import Problem


def write_counterexample(problem: Problem, confirmation: Confirmation, directory: Path) -> list[Path]:
    """Write a confirmed counterexample as JSON and as a picture; return the files."""
    from falsifier.plotting import plot_evaluation, save_figure

    evaluation = confirmation.evaluation
    verdict = evaluation.verdict
    content = {
        "requirement": problem.name,
        "formula": str(problem.requirement.formula),
        "source": problem.source,
        "robustness": evaluation.robustness,
        "critical_time": verdict and verdict.critical_time,
        "predicate": verdict and verdict.predicate,
        "confirmed": confirmation.reason,
        "candidate": evaluation.candidate.to_json(),
    }
    data, picture = directory / "counterexample.json", directory / "counterexample.png"
    data.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    save_figure(plot_evaluation(problem, evaluation), picture)
    return [data, picture]
