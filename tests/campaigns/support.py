"""Small campaigns over Python functions, and what is compared of them."""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from falsifier.campaigns import CampaignRequest, cross
from falsifier.campaigns.analysis import Run, load
from falsifier.evaluation.workers import LastingExecutor
from falsifier.problem.problem import Problem
from falsifier.problem.source import STL_NAME, ProblemSource
from falsifier.record.manifest import describe, write
from falsifier.search.budget import Budget
from falsifier.search.request import RunRequest
from tests.fmu.fixtures import path as fixture


def request(
    *names: str,
    engines: Sequence[str] = ("uniform",),
    seeds: int = 2,
    budget: int = 20,
    limits: Budget | None = None,
) -> CampaignRequest:
    """Campaign over problems of tests.problems."""
    return CampaignRequest(
        runs=cross(
            [
                ProblemSource(target=f"python:tests.problems:{name}", parameterization="fixed")
                for name in names
            ],
            engines,
            seeds=range(seeds),
            budget=Budget(budget),
        ),
        limits=limits,
    )


def work_in_threads(patch: pytest.MonkeyPatch) -> None:
    """Give campaigns workers without the time that processes take to start."""

    @contextmanager
    def pool(jobs: int) -> Iterator[list[LastingExecutor]]:
        workers = [LastingExecutor(lambda: ThreadPoolExecutor(1)) for _ in range(jobs)]
        try:
            yield workers
        finally:
            for worker in workers:
                worker.shutdown()

    patch.setattr("falsifier.campaigns.runner.open_workers", pool)


def outcomes(directory: Path) -> list[tuple[object, ...]]:
    """What must not depend on how often a campaign was killed: everything but times."""
    return [_outcome(run) for run in load(directory)]


def _outcome(run: Run) -> tuple[object, ...]:
    return (
        run.directory.name,
        run.status,
        run.reason,
        run.simulations,
        run.robustness.tolist(),
        run.counterexample,
        run.verdict,
    )


def record_ad_hoc(folder: Path, formulas: Mapping[str, str], named: Mapping[str, str] | None = None) -> None:
    """Begin a run per formula, each in the directory that it is given by; most without a name."""
    for place, formula in formulas.items():
        name = (named or {}).get(place, STL_NAME)
        problem = Problem.from_fmu(
            fixture("CheapLag_2"), formula, name=name, inputs={"u": (-1, 1, 3)}, stop_time=1.0
        )
        asked = RunRequest(problems=(problem.source,) if problem.source else ())
        (folder / place).mkdir()
        write(folder / place, describe(asked, [problem], "uniform"))
