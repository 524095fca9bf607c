"""Runs as values, and as tidy columns.

A search shared by several requirements appears as one run per requirement.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from falsifier.campaigns.directory import is_campaign, read_campaign, run_directories
from falsifier.campaigns.request import Method, method_of, method_of_run
from falsifier.core.arguments import path_of
from falsifier.counterexamples.store import file_of
from falsifier.problem.source import STL_NAME
from falsifier.record import manifest as manifests
from falsifier.record.journal import read_journal, recorded_evaluations
from falsifier.record.manifest import Manifest
from falsifier.record.summary import RunFollower, Summary
from falsifier.search.request import RunRequest
from falsifier.search.result import Columns, evaluation_columns, frame as as_frame
from falsifier.stl.margins import signed

if TYPE_CHECKING:
    import pandas


@dataclass(kw_only=True, repr=False)
class RunProgress(Summary):
    """Progress of one requirement in one run, which need not have started.

    Attributes:
        name: name of the run's directory.
        requirement: name of the requirement; numbered if another run has another formula of the same name.
        method: how it searches.
        seed: seed of the engine.
        request: what was asked for.
    """

    name: str
    requirement: str
    method: Method
    seed: int
    request: RunRequest

    def __repr__(self) -> str:
        # All its simulations would fill pages of a terminal, for each run of a campaign.
        return f"<{self}>"

    def __str__(self) -> str:
        best = "" if self.best_robustness is None else f", best robustness {signed(self.best_robustness)}"
        after = f"{self.status} after {self.spent.simulations_text}{best}"
        reason = f": {self.reason}" if self.status == "failed" else ""
        return f"{self.requirement} {self.method.label} seed {self.seed}: {after}{reason}"

    @property
    def simulations(self) -> int:
        """Number of simulations."""
        return self.spent.simulations

    @property
    def counts(self) -> bool:
        """Whether tables count it, because it ended with a result."""
        return self.finished


@dataclass(eq=False, kw_only=True, repr=False)
class Run(RunProgress):
    """One requirement in one run, read from its directory: its numbers (see Summary) and what was requested.

    Attributes:
        directory: run directory.
        manifest: its manifest, reduced to this requirement.
    """

    directory: Path
    manifest: Manifest

    @property
    def is_ad_hoc(self) -> bool:
        """Whether the requirement is a formula to which nobody gave a name."""
        source = self.request.source
        return source is not None and source.stl is not None and source.stl_name == STL_NAME

    @property
    def counterexample_file(self) -> Path:
        """Path of the counterexample, for ``falsifier replay``, which creates the file if it is missing."""
        return self.directory / file_of(self.manifest.requirement.name, shared=self.method.together)

    @property
    def counts(self) -> bool:
        """Whether tables count it: it ended with a result, or spent its budget and not all of it failed."""
        budget, spent = self.request.budget, replace(self.spent, cost=self.spent.cost or 0.0)
        is_spent = self.best is not None and budget.exceeded(spent) is not None
        return self.finished or (self.status == "failed" and is_spent)

    def columns(self) -> Columns:
        """Read every evaluation; return one row each, as columns of equal length; see evaluation_columns.

        Raises:
            JournalError: if the record is damaged.
        """
        found = recorded_evaluations(read_journal(self.directory), self.manifest.requirement.name)
        return evaluation_columns([found[i] for i in range(len(self.robustness))])

    def frame(self) -> "pandas.DataFrame":
        """Return the same as a data frame of pandas.

        Raises:
            JournalError: if the record is damaged.
            SpecError: if pandas is not installed.
        """
        return as_frame(self.columns())


def load(directory: str | PathLike[str]) -> list[Run]:
    """Load all runs of a campaign, of a run directory, or of a folder of run directories.

    Raises:
        JournalError: if the directory is none of these, or a file in it is invalid.
        SpecError: if it is not a path.
    """
    places = run_directories(path_of("directory", directory))
    runs = [run for place in places for run in RunFollower(place, unread_runs(place)).look()]
    formulas: dict[str, dict[str, str]] = {}
    for run in runs:
        formulas.setdefault(run.requirement, {})[run.manifest.requirement.formula] = run.requirement
    for name, numbered in formulas.items():  # runs of --stl all have the same name
        unused = (new for k in count(1) if (new := f"{name}-{k}") not in formulas)
        if len(numbered) > 1:
            numbered.update(zip([*numbered], unused, strict=False))
    for run in runs:
        run.requirement = formulas[run.requirement][run.manifest.requirement.formula]
    return runs


def not_begun(directory: str | PathLike[str], begun: Sequence[Run]) -> list[RunProgress]:
    """Return the runs of a campaign that have not begun, which tables count beside those that have."""
    place, known = path_of("directory", directory), {run.directory.name for run in begun}
    names = {run.request.problems[0]: run.requirement for run in begun if run.request.problems}
    left = [run for run in requested_runs(place) if run.name not in known] if is_campaign(place) else []
    return [replace(run, requirement=names.get(run.request.problems[0], run.requirement)) for run in left]


def requested_runs(directory: Path) -> list[RunProgress]:
    """Return the runs of a campaign as they were asked for, before anything is read of them."""
    return [
        RunProgress(name=name, requirement=r.problems[0].name, method=method_of(r), seed=r.seed, request=r)
        for name, r in read_campaign(directory).request.named().items()
    ]


def load_run(directory: str | PathLike[str], requirement: str | None = None) -> Run:
    """Load one run directory; trajectories stay on disk.

    Args:
        directory: run directory.
        requirement: name of the requirement, if several share the search.

    Raises:
        JournalError: if a file is invalid, or several requirements share the search and none is named.
        SpecError: if the directory is not a path.
    """
    place = path_of("directory", directory)
    name = manifests.read(place).of(requirement).requirement.name
    (run,) = (run for run in RunFollower(place, unread_runs(place)).look() if run.requirement == name)
    return run


def unread_runs(directory: Path) -> list[Run]:
    """Return the runs of a directory, one per requirement, before their journal is read."""
    manifest = manifests.read(directory)
    return [
        Run(
            directory=directory,
            manifest=manifest.of(name),
            name=str(directory),
            requirement=name,
            method=method_of_run(manifest),
            seed=manifest.request.seed,
            request=manifest.request,
            recorded_as=name,
        )
        for name in manifest.names
    ]


def columns(runs: Iterable[Run]) -> dict[str, list[Any]]:
    """One row per run, as plain columns of equal length."""
    rows = [_row(run) for run in runs]
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def frame(runs: Iterable[Run]) -> "pandas.DataFrame":
    """One row per run, as a data frame of pandas; SpecError if that is not installed."""
    return as_frame(columns(runs))


def _row(run: Run) -> dict[str, Any]:
    spent, verdict = run.spent, run.verdict
    return {
        "requirement": run.requirement,
        "method": run.method.label,
        **asdict(run.method),  # all in which methods can differ
        "seed": run.seed,
        "status": run.status,
        "falsified": run.falsified,
        "simulations": run.simulations,
        "robustness": verdict.robustness if verdict else None,
        "critical_time": verdict.critical_time if verdict else None,
        "simulation_seconds": spent.simulation_seconds,
        "engine_seconds": spent.engine_seconds,
        "seconds": spent.seconds,
        "tokens": spent.tokens,
        "cost": spent.cost,
        "directory": str(run.directory),
    }
