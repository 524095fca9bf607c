"""What campaigns and their reports cost beside the simulations.

Usage: python bench/campaign.py; prints the table. Committed result: bench/campaign.md.
"""

import json
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from statistics import quantiles
from time import perf_counter

from falsifier.analysis import load, load_run
from falsifier.budget import Budget
from falsifier.campaign import CampaignRequest, Method, cross, suite
from falsifier.campaign.directory import CampaignRecord, run_directory, write_campaign
from falsifier.evaluation import evaluate
from falsifier.events import Evaluated, Event
from falsifier.journal import EndedRecord, EvaluatedRecord, VerdictRecord, read_journal
from falsifier.manifest import environment, manifest
from falsifier.problem import load_problem
from falsifier.report import html_report
from falsifier.request import ProblemRequest, RunRequest
from falsifier.session import execute

SIMULATIONS = 300
LONG_JOURNAL = 10_000
BUDGET = 1500


def main() -> None:
    """Measure and print."""
    print(
        f"Python {platform.python_version()}, {platform.machine()}; medians over {SIMULATIONS} simulations\n"
    )
    print(
        "| requirement | simulator ms | engine ms | judging ms | record ms | all else ms "
        "| share of record and else |"
    )
    print("|---|---|---|---|---|---|---|")
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
    """Return where a simulation's time goes in a recorded run, as a row of the table."""
    request = cross(suite_of(target), [Method("uniform")], seeds=[0], budget=Budget(SIMULATIONS))[0]
    bare = execute_timed(request, None)
    recorded = execute_timed(request, directory)
    records = read_journal(directory)
    simulator = quick(r.seconds for r in records if isinstance(r, EvaluatedRecord)) * 1e3
    engine = quick(r.seconds for r in records if r.kind == "asked") * 1e3
    problem = load_problem(target)
    candidate = problem.space.decode([d.low for d in problem.space.dimensions])
    judging = judging_time(lambda: evaluate(problem, candidate).seconds) * 1e3
    problem.model.close()
    record = recorded - bare
    rest = bare - simulator - engine - judging
    share = (record + max(rest, 0.0)) / recorded
    cells = (f"{x:.3f}" for x in (simulator, engine, judging, record, rest))
    return f"| {target.split(':')[1]} | {' | '.join(cells)} | {share:.1%} |"


def quick(times: Iterable[float]) -> float:
    """Lower decile: the time that something takes when nothing else wants the processor."""
    return quantiles(times, n=10)[0]


def suite_of(target: str) -> list[ProblemRequest]:
    """The suite's request for one target."""
    return [request for request in suite("arch-comp") if request.target == target]


def execute_timed(request: RunRequest, directory: Path | None) -> float:
    """Time in ms from one evaluation to the next."""
    times: list[float] = []

    def note(event: Event) -> None:
        if isinstance(event, Evaluated):
            times.append(perf_counter())

    execute(request, directory, listeners=[note])
    return quick(b - a for a, b in pairwise(times)) * 1e3


def judging_time(simulate: Callable[[], float]) -> float:
    """What an evaluation takes beside the simulation: sampling the inputs and the monitor."""
    simulate()
    differences = []
    for _ in range(50):
        started = perf_counter()
        seconds = simulate()
        differences.append(perf_counter() - started - seconds)
    return quick(differences)


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
    problem = request.problem.load()
    place.mkdir(parents=True)
    (place / "trajectories").mkdir()
    (place / "manifest.json").write_text(manifest(request, problem).model_dump_json())
    low, high = problem.space.bounds.T
    candidate = problem.space.decode(low + (high - low) * ((request.seed + 1) / 11))
    evaluation = evaluate(problem, candidate)
    assert evaluation.trajectory is not None
    assert evaluation.verdict is not None
    evaluation.trajectory.save(place / "trajectories" / f"{BUDGET - 1}.npz")
    verdict = VerdictRecord(**{f: getattr(evaluation.verdict, f) for f in VerdictRecord.model_fields})
    asked = json.dumps(candidate.to_json())
    with (place / "journal.jsonl").open("w") as file:
        for i in range(BUDGET):
            file.write(f'{{"kind":"asked","first":{i},"n":1,"candidates":[{asked}],"seconds":0.0001}}\n')
            falling = verdict.model_copy(update={"robustness": float(BUDGET - i) if i < BUDGET - 1 else -1.0})
            record = EvaluatedRecord(index=i, status="ok", verdict=falling, seconds=0.01)
            if i == BUDGET - 1:
                record = record.model_copy(update={"trajectory": f"trajectories/{i}.npz"})
            file.write(record.model_dump_json() + "\n")
        confirmed = {"kind": "confirmed", "index": BUDGET - 1, "outcome": "confirmed", "robustness": -1.0}
        file.write(json.dumps({**confirmed, "reference": -1.0, "reason": "made for a measurement"}) + "\n")
        file.write(
            EndedRecord(status="falsified", reason="", spent={"simulations": BUDGET}).model_dump_json() + "\n"
        )


if __name__ == "__main__":
    main()
