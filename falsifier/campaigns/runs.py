"""Runs as values, and as tidy columns.

A search shared by several requirements appears as one run per requirement.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.directory import run_directories
from falsifier.campaigns.request import Method, method_of_run
from falsifier.counterexamples.store import file_of
from falsifier.errors import JournalError
from falsifier.problem.source import STL_NAME
from falsifier.record import manifest as manifests
from falsifier.record.journal import read_journal, recorded_evaluations
from falsifier.record.manifest import Manifest
from falsifier.record.summary import RunStatus, Summary, read_summary
from falsifier.search.budget import Spent
from falsifier.search.findings import Failure, Finding
from falsifier.search.result import Columns, evaluation_columns
from falsifier.search.result import frame as as_frame
from falsifier.stl.monitor import Verdict

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Run:
    """One run, read from its directory.

    Attributes:
        directory: run directory.
        manifest: its manifest, reduced to this requirement.
        shared: whether several requirements shared this search.
        method: how it searched.
        status: how it ended, or ``running``.
        reason: why it ended.
        robustness: robustness of each evaluation in order, shape (n,); NaN without a verdict.
        best: index of the evaluation with the smallest robustness, or None.
        verdict: verdict of the counterexample, otherwise of the best evaluation, or None.
        counterexample: index of the confirmed violation, or None.
        unconfirmed: outcome and reason of violations that were not confirmed, by index.
        trajectories: names of kept trajectory files, by index.
        spent: what it has spent.
        findings: what the search could not show; empty before it has ended.
        failures: why simulations failed, by cause.
        requirement: name of the requirement; numbered if another run has another formula of the same name.
    """

    directory: Path
    manifest: Manifest
    shared: bool
    method: Method
    status: RunStatus
    reason: str
    robustness: NDArray[np.float64]
    best: int | None
    verdict: Verdict | None
    counterexample: int | None
    unconfirmed: dict[int, str]
    trajectories: dict[int, str]
    spent: Spent
    findings: tuple[Finding, ...] = ()
    failures: tuple[Failure, ...] = ()
    requirement: str

    @property
    def is_ad_hoc(self) -> bool:
        """Whether the requirement is a formula to which nobody gave a name."""
        source = self.manifest.request.source
        return source is not None and source.stl is not None and source.stl_name == STL_NAME

    @property
    def counterexample_file(self) -> Path:
        """Path of the counterexample, for ``falsifier replay``, which creates the file if it is missing."""
        return self.directory / file_of(self.manifest.requirement.name if self.shared else "")

    @property
    def seed(self) -> int:
        """Seed of the engine."""
        return self.manifest.request.seed

    @property
    def falsified(self) -> bool:
        """Whether a confirmed counterexample was found."""
        return self.status == "falsified"

    @property
    def finished(self) -> bool:
        """Whether it ended with a result: falsified, or budget used up."""
        return self.status in ("falsified", "not falsified")

    @property
    def simulations(self) -> int:
        """Number of simulations."""
        return self.spent.simulations

    def columns(self) -> Columns:
        """Read every evaluation; return one row each, as columns of equal length; see evaluation_columns.

        Raises:
            JournalError: if the record is damaged.
        """
        records = read_journal(self.directory)
        name = self.manifest.requirement.name
        found = recorded_evaluations(self.directory, records, name, with_trajectories=False)
        return evaluation_columns([found[i] for i in range(len(self.robustness))])

    def frame(self) -> "pandas.DataFrame":
        """Return the same as a data frame of pandas.

        Raises:
            JournalError: if the record is damaged.
            SpecError: if pandas is not installed.
        """
        return as_frame(self.columns())


def load(directory: Path) -> list[Run]:
    """Load all runs of a campaign, of a run directory, or of a folder of run directories.

    Raises:
        JournalError: if the directory is none of these, or a file in it is invalid.
    """
    described = ((path, manifests.read(path)) for path in run_directories(directory))
    return _told_apart(
        [_run(path, manifest, name) for path, manifest in described for name in manifest.names]
    )


def load_run(directory: Path, requirement: str | None = None) -> Run:
    """Load one run directory; trajectories stay on disk.

    Args:
        directory: run directory.
        requirement: name of the requirement, if several share the search.

    Raises:
        JournalError: if a file is invalid, or several requirements share the search and none is named.
    """
    manifest = manifests.read(directory)
    if requirement is None and manifest.shared:
        names = ", ".join(manifest.names)
        raise JournalError(f"{directory}: several requirements share this run; choose one of {names}")
    return _run(directory, manifest, requirement or manifest.names[0])


def _told_apart(runs: list[Run]) -> list[Run]:
    """Number the names that stand for several formulas: runs of ``--stl`` all have the same name."""
    formulas: dict[str, list[str]] = {}
    for run in runs:
        known = formulas.setdefault(run.requirement, [])
        known += [run.manifest.requirement.formula] if run.manifest.requirement.formula not in known else []
    return [
        replace(run, requirement=f"{run.requirement}-{known.index(run.manifest.requirement.formula) + 1}")
        if len(known := formulas[run.requirement]) > 1
        else run
        for run in runs
    ]


def _run(directory: Path, manifest: Manifest, requirement: str) -> Run:
    described = manifest.of(requirement)  # which refuses a requirement that the run does not have
    return run_of(directory, described, read_summary(directory, requirement), shared=manifest.shared)


def run_of(directory: Path, manifest: Manifest, summary: Summary, *, shared: bool) -> Run:
    """Return a run whose journal has been read.

    Args:
        directory: run directory.
        manifest: its manifest, reduced to one requirement.
        summary: numbers of that requirement in its journal.
        shared: whether several requirements share the search.
    """
    method = replace(method_of_run(manifest), together=shared)
    return Run(
        directory=directory,
        manifest=manifest,
        shared=shared,
        method=method,
        status=summary.status,
        reason=summary.reason,
        robustness=summary.robustness,
        best=summary.best,
        verdict=summary.verdict,
        counterexample=summary.counterexample,
        unconfirmed=summary.unconfirmed,
        trajectories=summary.trajectories,
        spent=summary.spent,
        findings=summary.findings,
        failures=summary.failures,
        requirement=manifest.requirement.name,
    )


def columns(runs: Iterable[Run]) -> dict[str, list[Any]]:
    """One row per run, as plain columns of equal length."""
    rows = [_row(run) for run in runs]
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def frame(runs: Iterable[Run]) -> "pandas.DataFrame":
    """One row per run, as a pandas data frame.

    Raises:
        SpecError: if pandas is not installed.
    """
    return as_frame(columns(runs))


def _row(run: Run) -> dict[str, Any]:
    return {
        "requirement": run.requirement,
        "method": run.method.label,
        "engine": run.method.engine,
        "llm": run.method.llm,
        "effort": run.method.effort,
        "variant": run.method.variant,
        "parameterization": run.method.parameterization,
        "profile": run.method.profile,
        "seed": run.seed,
        "status": run.status,
        "falsified": run.falsified,
        "simulations": run.simulations,
        "robustness": run.verdict.robustness if run.verdict else None,
        "critical_time": run.verdict.critical_time if run.verdict else None,
        "simulation_seconds": run.spent.simulation_seconds,
        "engine_seconds": run.spent.engine_seconds,
        "seconds": run.spent.seconds,
        "tokens": run.spent.tokens,
        "cost": run.spent.cost,
        "directory": str(run.directory),
    }
