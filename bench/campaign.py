"""What campaigns and their reports cost beside the simulations.

Usage: python bench/campaign.py; prints the table. Committed result: bench/campaign.md.
"""

import json
import platform
import shutil
import tempfile
from pathlib import Path
from statistics import quantiles
from time import perf_counter, process_time

from falsifier.analysis import load, load_run
from falsifier.budget import Budget
from falsifier.campaign import CampaignRequest, Method, cross, suite
from falsifier.campaign.directory import CampaignRecord, run_directory, write_campaign
from falsifier.evaluation import evaluate, monitor_for
from falsifier.journal import EndedRecord, EvaluatedRecord, VerdictRecord, read_journal
from falsifier.manifest import environment, manifest
from falsifier.proposers import make_proposer
from falsifier.report import html_report
from falsifier.request import ProblemRequest, RunRequest
from falsifier.session import perform

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
    """Return where a simulation's time goes in a recorded run, as a row of the table.

    Simulations: lower decile of wall-clock time, for the machine is rarely alone. All else: processor time of
    this process, in which the FMU does not run; recording and the loop are what is left of a whole run's
    without that of the same asking and the same evaluating.
    """
    request = cross(suite_of(target), [Method("uniform")], seeds=[0], budget=Budget(SIMULATIONS))[0]
    problem = request.problem.load()
    described = manifest(request, problem)
    perform(request, [problem], described, None)
    started = process_time()
    perform(request, [problem], described, directory)
    whole = process_time() - started
    records = read_journal(directory)
    seconds = [r.seconds for r in records if isinstance(r, EvaluatedRecord)]
    proposer = make_proposer("uniform", problem, seed=0)
    started = process_time()
    candidates = [proposer.ask(1)[0] for _ in seconds]
    engine = process_time() - started
    started = process_time()
    evaluations = [evaluate(problem, candidate) for candidate in candidates]
    evaluating = process_time() - started
    started = process_time()
    for evaluation in evaluations:
        assert evaluation.trajectory is not None
        monitor_for(problem).evaluate(evaluation.trajectory)
    judging = process_time() - started
    problem.model.close()
    count = len(seconds)
    parts = [
        quantiles(seconds, n=10)[0],
        *(x / count for x in (engine, judging, whole - engine - evaluating)),
    ]
    cells = (f"{1e3 * part:.3f}" for part in parts)
    return f"| {target.split(':')[1]} | {' | '.join(cells)} | {parts[-1] / sum(parts):.1%} |"


def suite_of(target: str) -> list[ProblemRequest]:
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
