"""Files that commands leave behind: a counterexample as JSON with its picture beside it."""

from pathlib import Path

from falsifier.counterexamples.store import FILE_NAME, save, to_store
from falsifier.evaluation.confirm import Confirmation
from falsifier.problem.problem import Problem
from falsifier.search.request import ProblemRequest


def write_counterexample(
    problem: Problem,
    confirmation: Confirmation,
    directory: Path,
    *,
    request: ProblemRequest | None = None,
    name: str = FILE_NAME,
) -> list[Path]:
    """Write a counterexample as JSON, as ``falsifier replay`` reads it, and as a picture; return the files.

    Args:
        problem: what it violates.
        confirmation: the violation.
        directory: where to write.
        request: how the problem is loaded; None where only code can tell.
        name: of the JSON file; the picture is named like it.
    """
    from falsifier.views.plotting import plot_evaluation, save_figure

    data = save(to_store(problem, confirmation, request), directory / name)
    picture = data.with_suffix(".png")
    save_figure(plot_evaluation(problem, confirmation.evaluation), picture)
    return [data, picture]
