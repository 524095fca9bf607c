"""What campaigns and their reports cost beside the simulations.

Usage: python bench/campaign.py; prints the table. Committed result: bench/campaign.md.
"""

import json
import platform
import shutil
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from time import perf_counter
from typing import Any

from falsifier.campaigns import CampaignRequest, Method, cross, suite
from falsifier.campaigns.analysis import load, load_run
from falsifier.campaigns.directory import CampaignRecord, run_directory, write_campaign
from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.journal import open_journal, write_manifest
from falsifier.search.loop import Live, search
from falsifier.search.manifest import describe, environment
from falsifier.search.records import ConfirmedRecord, EndedRecord, EvaluatedRecord, VerdictRecord
from falsifier.search.request import RunRequest
from falsifier.search.run import falsify
from falsifier.views.report import html_report

SIMULATIONS = 1000
LONG_JOURNAL = 10_000
BUDGET = 1500


def main() -> None:
    """Measure and print."""
    print(f"Python {platform.python_version()}, {platform.machine()}; {SIMULATIONS} simulations each.\n")
    print("| requirement | simulation ms | engine ms | judging ms | record and loop ms | share of the last |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for target in ("AT:AT1", "CC:CC4", "NN:NNx", "SC:SC"):
            print(overhead(target, Path(folder) / target.replace(":", "-")), flush=True)
        seconds, count = long_journal(Path(folder) / "AT-AT1", Path(folder) / "long")
        print(f"\nA journal of {count} simulations is loaded in {seconds:.2f} s.")
        seconds, runs, size = full_report(Path(folder))
        print(
            f"A report on {runs} runs of {BUDGET} simulations is written in {seconds:.1f} s, "
            f"{size / 1e6:.1f} MB."
        )


def overhead(target: str, directory: Path) -> str:
    """Return where the wall-clock time of a recorded run goes, per simulation, as a row of the table.

    Judging is sampling the inputs and the monitor; record and loop is what is left beside the simulations,
    the engine and judging.
    """
    request = cross(suite_of(target), [Method("uniform")], seeds=[0], budget=Budget(SIMULATIONS))[0]
    problem = load_source(request.problems[0])
    falsify(problem, "uniform", budget=10)
    write_manifest(directory, describe(request, [problem], "uniform").model_dump(mode="json"))
    engine, executor = TimedEngine(make_engine("uniform", problem, seed=0)), TimedExecutor()
    with open_journal(directory, keep=request.keep) as journal:
        started = perf_counter()
        steps = Live(executor)
        (result,) = search([problem], [engine], request.budget, steps=steps, listeners=[journal])
        whole = perf_counter() - started
    problem.model.close()
    simulating = result.spent.simulation_seconds
    judging = executor.seconds - simulating
    parts = [simulating, engine.seconds, judging, whole - executor.seconds - engine.seconds]
    cells = (f"{1e3 * part / result.spent.simulations:.3f}" for part in parts)
    return f"| {target.split(':')[1]} | {' | '.join(cells)} | {parts[-1] / whole:.1%} |"


class TimedEngine:
    """An engine and the seconds that it took."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.seconds = engine, 0.0
        self.name = engine.name

    def ask(self, n: int = 1) -> list[Candidate]:
        """See Engine.ask."""
        started = perf_counter()
        candidates = self.engine.ask(n)
        self.seconds += perf_counter() - started
        return candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """See Engine.tell."""
        started = perf_counter()
        self.engine.tell(evaluations)
        self.seconds += perf_counter() - started


class TimedExecutor(Executor):
    """Runs what it is given at once and counts the seconds."""

    seconds = 0.0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See Executor.submit."""
        done: Future[Any] = Future()
        started = perf_counter()
        done.set_result(fn(*args, **kwargs))
        self.seconds += perf_counter() - started
        return done


def suite_of(target: str) -> list[ProblemSource]:
    """The suite's request for one target."""
    return [request for request in suite("arch-comp") if request.target == target]


def long_journal(run: Path, place: Path) -> tuple[float, int]:
    """Time to load a journal that repeats a run's lines, and its simulations."""
    place.mkdir()
    shutil.copy(run / "manifest.json", place)
    pairs = [
        line for line in (run / "journal.jsonl").read_text().splitlines() if '"kind":"ended"' not in line
    ]
    with (place / "journal.jsonl").open("w") as file:
        for i in range(2 * LONG_JOURNAL):
            file.write(pairs[i % len(pairs)] + "\n")
    started = perf_counter()
    count = len(load_run(place).robustness)
    return perf_counter() - started, count


def full_report(folder: Path) -> tuple[float, int, int]:
    """Time to write the report of a whole suite whose runs all found something at their last simulation."""
    runs = cross(suite("arch-comp"), [Method("uniform")], seeds=range(10), budget=Budget(BUDGET))
    request = CampaignRequest(runs=runs, suite="arch-comp")
    directory = folder / "suite"
    write_campaign(directory, CampaignRecord(**environment(), request=request, hashes={}))
    for name, run in request.named().items():
        make_run(run, run_directory(directory, name))
    started = perf_counter()
    page = html_report(directory)
    seconds = perf_counter() - started
    return seconds, len(load(directory)), len(page)


def make_run(request: RunRequest, place: Path) -> None:
    """A run directory as a search leaves it, with one real simulation in place of all."""
    problem = load_source(request.problems[0])
    place.mkdir(parents=True)
    (place / "trajectories").mkdir()
    write_manifest(place, describe(request, [problem], "uniform").model_dump(mode="json"))
    low, high = problem.space.bounds.T
    candidate = problem.space.decode(low + (high - low) * ((request.seed + 1) / 11))
    evaluation = evaluate(problem, candidate)
    assert evaluation.trajectory is not None
    assert evaluation.verdict is not None
    evaluation.trajectory.save(place / "trajectories" / f"{BUDGET - 1}.npz")
    verdict = VerdictRecord.of(evaluation.verdict)
    assert verdict is not None
    asked = json.dumps(candidate.to_json())
    with (place / "journal.jsonl").open("w") as file:
        for i in range(BUDGET):
            file.write(f'{{"kind":"asked","first":{i},"n":1,"candidates":[{asked}],"seconds":0.0001,')
            file.write(f'"requirement":"{problem.name}"}}\n')
            falling = verdict.model_copy(update={"robustness": float(BUDGET - i) if i < BUDGET - 1 else -1.0})
            record = EvaluatedRecord(index=i, status="ok", verdicts={problem.name: falling}, seconds=0.01)
            if i == BUDGET - 1:
                record = record.model_copy(update={"trajectory": f"trajectories/{i}.npz"})
            file.write(record.model_dump_json() + "\n")
        confirmed = ConfirmedRecord(
            index=BUDGET - 1,
            requirement=problem.name,
            outcome="confirmed",
            robustness=-1.0,
            reference=-1.0,
            reason="made for a measurement",
            spent={"simulations": BUDGET},
        )
        file.write(confirmed.model_dump_json() + "\n")
        file.write(
            EndedRecord(status="falsified", reason="", spent={"simulations": BUDGET}).model_dump_json() + "\n"
        )


if __name__ == "__main__":
    main()
