"""A run over a Python function."""

from pathlib import Path

from falsifier.problem.problem import Problem
from falsifier.record.journal import holds_run
from falsifier.record.run import falsify, resume
from falsifier.search.result import Result


def run(
    problem: Problem,
    directory: Path | None = None,
    *,
    engine: str = "uniform",
    budget: int = 20,
    seed: int = 1,
) -> Result:
    """Run, or continue where the directory holds a run already."""
    if directory is not None and holds_run(directory):
        return resume(directory, problems=[problem])[0]
    return falsify(problem, engine, budget=budget, seed=seed, directory=directory)
