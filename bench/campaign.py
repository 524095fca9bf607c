"""Overhead of campaigns and their reports, in addition to the simulations.

Usage: python bench/campaign.py; prints the table. Committed result: bench/campaign.md.
"""

import argparse
import platform
import shutil
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from falsifier.campaigns import CampaignRequest, cross, suite
from falsifier.campaigns.analysis import load, load_run
from falsifier.campaigns.directory import CampaignRecord, run_directory, write_campaign
from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.record.files import save_trajectory
from falsifier.record.journal import open_journal, read_journal
from falsifier.record.manifest import describe, environment, write
from falsifier.record.records import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    EvaluatedRecord,
    Record,
    line_of,
)
from falsifier.record.run import falsify
from falsifier.search.budget import Budget, Spent
from falsifier.search.loop import search
from falsifier.search.request import RunRequest
from falsifier.search.steps import Steps
from falsifier.views.report import html_report

SIMULATIONS = 1000
LONG_JOURNAL = 10_000
BUDGET = 1500


def main() -> None:
    """Measure, and print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    print(f"Python {platform.python_version()}, {platform.machine()}; {SIMULATIONS} simulations each.\n")
    print("| requirement | simulation ms | engine ms | monitor ms | record and loop ms | share of the last |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for target in ("AT:AT1", "CC:CC4", "NN:NNx", "SC:SC"):
            print(overhead(target, Path(folder) / target.replace(":", "-")), flush=True)
        seconds, count = long_journal(Path(folder) / "AT-AT1", Path(folder) / "long")
        print(f"\nLoading a journal of {count} simulations takes {seconds:.2f} s.")
        seconds, runs, size = full_report(Path(folder))
        print(
            f"Writing a report on {runs} runs of {BUDGET} simulations ({size / 1e6:.1f} MB) takes "
            f"{seconds:.1f} s."
        )


def overhead(target: str, directory: Path) -> str:
    """Measure how the wall-clock time of a recorded run divides, per simulation; return a row of the table.

    "Monitor" includes sampling the inputs; "record and loop" is the remainder.
    """
    request = cross(suite_of(target), ["uniform"], seeds=[0], budget=Budget(SIMULATIONS))[0]
    problem = load_source(request.problems[0])
    falsify(problem, "uniform", budget=10)
    write(directory, describe(request, [problem], "uniform"))
    engine, executor = TimedEngine(make_engine("uniform", problem, seed=0)), TimedExecutor()
    with open_journal(directory, keep=request.keep) as journal:
        started = perf_counter()
        steps = Steps(executor)
        (result,) = search([problem], [engine], request.budget, steps=steps, listeners=[journal])
        whole = perf_counter() - started
    problem.model.close()
    simulating = result.spent.simulation_seconds
    monitoring = executor.seconds - simulating
    parts = [simulating, engine.seconds, monitoring, whole - executor.seconds - engine.seconds]
    cells = (f"{1e3 * part / result.spent.simulations:.3f}" for part in parts)
    return f"| {target.split(':')[1]} | {' | '.join(cells)} | {parts[-1] / whole:.1%} |"


class TimedEngine:
    """An engine that measures the time spent in its ``ask`` and ``tell``, in s."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.seconds = engine, 0.0
        self.name = engine.name

    def ask(self, n: int = 1) -> list[Candidate]:
        """Ask the wrapped engine and add the time that it takes."""
        started = perf_counter()
        candidates = self.engine.ask(n)
        self.seconds += perf_counter() - started
        return candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell the wrapped engine and add the time that it takes."""
        started = perf_counter()
        self.engine.tell(evaluations)
        self.seconds += perf_counter() - started


class TimedExecutor(Executor):
    """Runs each task immediately in this process and adds the time that it takes, in s."""

    seconds = 0.0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run the task and return its finished future."""
        done: Future[Any] = Future()
        started = perf_counter()
        done.set_result(fn(*args, **kwargs))
        self.seconds += perf_counter() - started
        return done


def suite_of(target: str) -> list[ProblemSource]:
    """Return the suite's problem source for one target."""
    return [request for request in suite("arch-comp") if request.target == target]


def long_journal(run: Path, place: Path) -> tuple[float, int]:
    """Return the time in s to load a journal that repeats a run's simulations, and how many it has."""
    place.mkdir()
    shutil.copy(run / "manifest.json", place)
    pairs = [record for record in read_journal(run) if record.kind != "ended"]
    with (place / "journal.jsonl").open("wb") as file:
        for i in range(2 * LONG_JOURNAL):
            record = pairs[i % len(pairs)]
            number = "first" if record.kind == "asked" else "index"
            file.write(line_of(record.model_copy(update={number: i // 2}), i + 1, pairs[0].run))
    started = perf_counter()
    count = len(load_run(place).robustness)
    return perf_counter() - started, count


def full_report(folder: Path) -> tuple[float, int, int]:
    """Measure writing the report of a whole suite in which every run falsified at its last simulation.

    Returns:
        Time in s, number of runs, size of the report in bytes.
    """
    runs = cross(suite("arch-comp"), ["uniform"], seeds=range(10), budget=Budget(BUDGET))
    request = CampaignRequest(runs=runs)
    directory = folder / "suite"
    write_campaign(directory, CampaignRecord(**environment(), request=request, hashes={}))
    for name, run in request.named().items():
        make_run(run, run_directory(directory, name))
    started = perf_counter()
    page = html_report(directory)
    seconds = perf_counter() - started
    return seconds, len(load(directory)), len(page)


def make_run(request: RunRequest, place: Path) -> None:
    """Write a run directory as a search does, but with one real simulation repeated."""
    problem = load_source(request.problems[0])
    place.mkdir(parents=True)
    (place / "trajectories").mkdir()
    described = describe(request, [problem], "uniform")
    write(place, described)
    low, high = problem.space.bounds.T
    candidate = problem.space.decode(low + (high - low) * ((request.seed + 1) / 11))
    evaluation = evaluate(problem, candidate)
    assert evaluation.trajectory is not None
    trajectory = save_trajectory(place, BUDGET - 1, evaluation.trajectory)
    verdict = evaluation.verdict
    assert verdict is not None
    records: list[Record] = []
    for i in range(BUDGET):
        records.append(
            AskedRecord(
                first=i,
                n=1,
                candidates=[candidate.to_json()],
                seconds=0.0001,
                requirement=problem.name,
                elapsed=0.01 * i,
            )
        )
        falling = replace(verdict, robustness=float(BUDGET - i) if i < BUDGET - 1 else -1.0)
        last = trajectory if i == BUDGET - 1 else None
        judged = {problem.name: falling}
        records.append(
            EvaluatedRecord(
                index=i,
                status="ok",
                verdicts=judged,
                seconds=0.01,
                trajectory=last,
                elapsed=0.01 * (i + 1),
            )
        )
    records.append(
        ConfirmedRecord(
            index=BUDGET - 1,
            requirement=problem.name,
            outcome="confirmed",
            robustness=-1.0,
            reference=-1.0,
            reason="written by a benchmark",
            spent=Spent(BUDGET),
        )
    )
    records.append(EndedRecord(status="falsified", reason="", spent=Spent(BUDGET)))
    lines = (line_of(record, number, described.run) for number, record in enumerate(records, 1))
    (place / "journal.jsonl").write_bytes(b"".join(lines))


if __name__ == "__main__":
    main()
