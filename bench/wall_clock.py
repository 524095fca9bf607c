"""How long does it take until the first violation, by the clock?

    python bench/wall_clock.py                                    # engines beside the surrogate, one core
    python bench/wall_clock.py --methods surrogate --jobs 1 2 --requirements AT6a CC3 AFC27
    python bench/wall_clock.py --methods surrogate --jobs 1 2 --requirements AT6a PulseMeter --slower 0.3
    python bench/wall_clock.py --peer PEER/bin/python             # psy-taliro too, see peers.py

A run that finds nothing in --seconds counts as that.
The methods take turns seed by seed, so that another load of the machine hits all of them. Seconds are those
of a run until its counterexample is confirmed, with the start of the FMU and of worker processes, without
loading the spec and without the start of psy-taliro's process, which searches the fixed parameterization;
--slower lets each simulation wait that much longer, as a larger FMU would take. Committed result:
bench/wall_clock.md.
"""

import argparse
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from statistics import mean

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench.peers import PEERS, interpreter, peer_search
from bench.search import with_error
from falsifier import Budget, Problem, falsify, load_problem
from falsifier.core.experiment import Experiment
from falsifier.core.model import Model, ModelInfo
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.confirm import confirm

REQUIREMENTS = ("AT1", "AT6a", "CC3", "PulseMeter", "ChargerHandshake", "HeaterLimpHome")
METHODS = ("surrogate", "uniform", "corners", "cma", "coverage")


@dataclass(frozen=True)
class Slower:
    """A model whose simulations wait."""

    model: Model
    seconds: float

    @property
    def info(self) -> ModelInfo:
        """What the model says of itself."""
        return self.model.info

    @property
    def has_own_processes(self) -> bool:
        """Whether it simulates in processes of its own."""
        return bool(getattr(self.model, "has_own_processes", False))

    def simulate(
        self, signals: Mapping[str, Signal], parameters: Mapping[str, float], experiment: Experiment
    ) -> Trajectory:
        """Wait, then simulate."""
        time.sleep(self.seconds)
        return self.model.simulate(signals, parameters, experiment)

    def close(self) -> None:
        """Release the model."""
        self.model.close()


@dataclass(frozen=True)
class Run:
    """One search: whether it found a violation, after how many simulations and s."""

    falsified: bool
    simulations: int
    seconds: float


def run(problem: Problem, method: str, *, jobs: int, seed: int, seconds: float) -> Run:
    """Search with one engine."""
    result = falsify(problem, method, budget=Budget(None, seconds=seconds), jobs=jobs, seed=seed)
    return Run(result.falsified, result.spent.simulations, result.spent.seconds)


def run_peer(problem: Problem, optimizer: str, python: Path, *, seed: int, seconds: float) -> Run:
    """Search with psy-taliro, and confirm what it found as ours is."""
    most = 1_000_000
    problem.model.close()  # as our runs do when they end, so that each starts the FMU
    found = peer_search(problem, optimizer, python, seed=seed, budget=most, limit=seconds)
    started = time.perf_counter()
    is_confirmed = found.violation is not None and confirm(problem, found.violation).outcome == "confirmed"
    return Run(is_confirmed, found.simulations, found.seconds + time.perf_counter() - started)


def cells(results: list[Run], limit: float) -> list[str]:
    """Falsified runs, simulations and seconds; a run that found nothing counts as the limit."""
    seconds = [r.seconds if r.falsified else limit for r in results]
    simulations = [r.simulations for r in results if r.falsified]
    return [
        f"{len(simulations)}/{len(results)}",
        f"{mean(simulations):.1f}" if simulations else "–",
        with_error(seconds, 2),
    ]


def main() -> None:
    """Print one line per requirement and method."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--requirements", nargs="+", default=REQUIREMENTS, metavar="NAME")
    parser.add_argument("--methods", nargs="+", default=METHODS, metavar="ENGINE")
    parser.add_argument("--jobs", nargs="+", type=int, default=[1])
    parser.add_argument("--slower", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--seconds", type=float, default=60.0, help="limit of each run")
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 104), metavar=("FIRST", "LAST"))
    parser.add_argument("--peer", type=interpreter, help="interpreter that can import staliro")
    options = parser.parse_args()
    print("| requirement | method | jobs | FR | simulations | seconds |\n|---|---|---|---|---|---|")
    for name in options.requirements:
        problem, fixed = load_problem(name), load_problem(name, parameterization="fixed")
        if options.slower:
            model = Slower(problem.model, options.slower)
            problem, fixed = replace(problem, model=model), replace(fixed, model=model)
        for method in options.methods:  # imports and compiles what is done once
            run(problem, method, jobs=1, seed=0, seconds=5.0)
        ways = list(product(options.methods, options.jobs))
        peers = PEERS if options.peer else ()
        results: dict[tuple[str, int], list[Run]] = {way: [] for way in ways}
        results |= {(f"psy-taliro, {peer}", 1): [] for peer in peers}
        for seed in range(options.seeds[0], options.seeds[1] + 1):
            for method, jobs in ways:
                found = run(problem, method, jobs=jobs, seed=seed, seconds=options.seconds)
                results[method, jobs].append(found)
            for peer in peers:
                found = run_peer(fixed, peer, options.peer, seed=seed, seconds=options.seconds)
                results[f"psy-taliro, {peer}", 1].append(found)
        for (method, jobs), all_found in results.items():
            words = " | ".join(cells(all_found, options.seconds))
            print(f"| {name} | {method} | {jobs} | {words} |", flush=True)


if __name__ == "__main__":
    main()
