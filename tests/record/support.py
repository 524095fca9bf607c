"""A run over a Python function."""

import json
from pathlib import Path
from typing import Any

from falsifier.core.files import seal
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


def write_manifest(directory: Path, content: dict[str, Any]) -> None:
    """Write a manifest that need not be valid, with its checksum."""
    kept = {key: value for key, value in content.items() if key != "sum"}
    (directory / "manifest.json").write_text(seal(json.dumps(kept, indent=2)), encoding="utf-8")
