"""How do the engines compare with psy-taliro in one run: same simulator, same parameterization, same machine?

psy-taliro needs an environment of its own; its optimizers are uniform sampling and dual annealing (scipy).

    python -m venv PEER && PEER/bin/pip install psy-taliro==3.2.0
    python bench/peers.py --peer PEER/bin/python

Every method searches the spec's fixed parameterization until the first violation or the end of the budget. FR
is the number of runs that found one, S the mean number of simulations, a miss counted as the budget, with its
standard error. Seconds are those of the whole search without the start of processes; overhead is what is left
of them without simulations. That of psy-taliro includes two lines through a pipe. Committed result:
bench/peers.md.
"""

import argparse
import json
import os
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench.search import with_error
from falsifier import Problem, load_problem
from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import Evaluation, evaluate

OURS = ("surrogate", "uniform", "corners", "cma")
PEERS = ("uniform", "dual annealing")
REQUIREMENTS = ("AT1", "AT2", "AT53", "AT6a", "CC1", "CC3", "CC4", "CC5", "F16")
FAULTS = ("PulseMeter", "ChargerHandshake", "HeaterLimpHome")


@dataclass(frozen=True, slots=True)
class Search:
    """One search.

    Attributes:
        simulations: number of simulations.
        seconds: duration in s.
        simulating: duration of the simulations in s, with the monitor.
        violation: what it found, not confirmed; None if nothing.
    """

    simulations: int
    seconds: float
    simulating: float
    violation: Evaluation | None = None

    @property
    def falsified(self) -> bool:
        """Whether it found a violation."""
        return self.violation is not None


def search(problem: Problem, engine: str, *, seed: int, budget: int) -> Search:
    """Search with one of our engines, fixed parameterization."""
    started, simulating = time.perf_counter(), 0.0
    asked = make_engine(engine, problem, seed=seed)
    for count in range(1, budget + 1):
        (candidate,) = asked.ask(1)
        begun = time.perf_counter()
        evaluation = evaluate(problem, candidate)
        simulating += time.perf_counter() - begun
        if _violates(evaluation):
            return Search(count, time.perf_counter() - started, simulating, evaluation)
        asked.tell([evaluation])
    return Search(budget, time.perf_counter() - started, simulating)


def peer_search(
    problem: Problem, optimizer: str, python: Path, *, seed: int, budget: int, limit: float = float("inf")
) -> Search:
    """Search with an optimizer of psy-taliro, which runs in its own process; its start is not counted.

    Args:
        problem: the problem.
        optimizer: one of PEERS.
        python: interpreter that can import staliro.
        seed: seed of the optimizer.
        budget: maximum number of simulations.
        limit: maximum duration in s.
    """
    task = {"optimizer": optimizer, "seed": seed, "budget": budget, "bounds": problem.space.bounds.tolist()}
    script = Path(__file__).with_name("peer_taliro.py")
    with subprocess.Popen(
        [str(python), str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as peer:
        assert peer.stdin is not None and peer.stdout is not None
        print(json.dumps(task), file=peer.stdin, flush=True)
        line, count, simulating = peer.stdout.readline(), 0, 0.0
        started = time.perf_counter()
        while line and count < budget and time.perf_counter() - started < limit:
            count += 1
            begun = time.perf_counter()
            candidate = problem.space.decode(np.array(json.loads(line)), origin="psy-taliro", rationale="")
            evaluation = evaluate(problem, candidate)
            simulating += time.perf_counter() - begun
            if _violates(evaluation):
                peer.kill()
                return Search(count, time.perf_counter() - started, simulating, evaluation)
            cost = float("inf") if evaluation.robustness is None else evaluation.robustness
            print(cost, file=peer.stdin, flush=True)
            line = peer.stdout.readline()
        if not line and peer.wait():
            raise SystemExit(f"psy-taliro failed after {count} simulations, so this search says nothing")
        peer.kill()
    return Search(budget, time.perf_counter() - started, simulating)


def _violates(evaluation: Evaluation) -> bool:
    return evaluation.robustness is not None and evaluation.robustness < 0


def row(requirement: str, method: str, searches: Sequence[Search]) -> str:
    """Return one row of the table."""
    counts = [s.simulations for s in searches]
    overhead = [(s.seconds - s.simulating) / s.simulations for s in searches]
    cells = (
        requirement,
        method,
        f"{sum(s.falsified for s in searches)}/{len(searches)}",
        with_error(counts),
        f"{mean(s.seconds for s in searches):.2f}",
        f"{1e3 * mean(overhead):.1f}",
    )
    return f"| {' | '.join(cells)} |"


def interpreter(text: str) -> Path:
    """Return the interpreter that a command line names; it must have psy-taliro."""
    command = ["sh", "-c", 'exec "$0" -c "import staliro"', text]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        raise argparse.ArgumentTypeError(f"{text} cannot import staliro; see bench/peers.py")
    return Path(text)


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--peer", type=interpreter, required=True, help="interpreter that can import staliro")
    parser.add_argument("--requirements", nargs="+", default=REQUIREMENTS + FAULTS, metavar="NAME")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds, from 100 on")
    parser.add_argument("--budget", type=int, default=300)
    options = parser.parse_args()
    print("| requirement | method | FR | S | s/search | overhead [ms/iteration] |")
    print("|---|---|---|---|---|---|")
    seeds = range(100, 100 + options.seeds)
    for requirement in options.requirements:
        problem = load_problem(requirement, parameterization="fixed")
        for engine in OURS:
            search(problem, engine, seed=0, budget=3)  # starts processes and imports what the engine needs
            found = [search(problem, engine, seed=seed, budget=options.budget) for seed in seeds]
            print(row(requirement, f"`{engine}`", found), flush=True)
        for peer in PEERS:
            found = [
                peer_search(problem, peer, options.peer, seed=seed, budget=options.budget) for seed in seeds
            ]
            print(row(requirement, f"psy-taliro, {peer}", found), flush=True)


if __name__ == "__main__":
    main()
