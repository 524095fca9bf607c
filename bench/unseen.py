"""Which engine finds the violations of small systems on which it was not tuned?

Searches for every requirement of the spec files in a folder with every engine. A cell is the mean number of
simulations until a confirmed violation, a miss counted as the budget, with its standard error; how many runs
found one; and the seconds of thinking per proposal. Violations that psy-taliro finds are
not confirmed. The last row is the mean over the requirements. The parameterization is fixed, because most
engines search no other; with ``--free``, it is free.

    python -m bench.unseen bench/development
    python -m bench.unseen bench/development --engines surrogate cma --systems Crane BottleLine --seeds 10-19
    python -m bench.unseen bench/development --engines surrogate coverage --free
    python -m bench.unseen bench/held_out --peer PEER/bin/python       # with psy-taliro, see peers.py
    python -m bench.unseen bench/development --rates 20000             # how often do uniform samples violate?
"""

import argparse
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from bench.peers import PEERS, interpreter, peer_search
from bench.search import seeds_from, with_error
from falsifier import ENGINES, Problem, evaluate, falsify, load_problem, make_engine
from falsifier.evaluation.evaluate import judge
from falsifier.problem.source import Parameterization

COMPARED = ("surrogate", "uniform", "corners", "cma", "optuna", "coverage")


@dataclass(frozen=True, slots=True)
class Run:
    """One search.

    Attributes:
        simulations: number of simulations until the violation, or the budget.
        found: whether a violation was confirmed.
        thinking: seconds in the engine per simulation.
    """

    simulations: int
    found: bool
    thinking: float


def own(problem: Problem, engine: str, *, seed: int, budget: int) -> Run:
    """Search with one of our engines."""
    result = falsify(problem, engine, seed=seed, budget=budget)
    spent = result.spent
    count = spent.simulations if result.falsified else budget
    return Run(count, result.falsified, spent.engine_seconds / max(1, spent.simulations))


def peer(problem: Problem, optimizer: str, python: Path, *, seed: int, budget: int) -> Run:
    """Search with one of psy-taliro's optimizers, whose seeds begin with 1."""
    found = peer_search(problem, optimizer, python, seed=seed + 1, budget=budget)
    return Run(found.simulations, found.falsified, (found.seconds - found.simulating) / found.simulations)


def cell(runs: Sequence[Run]) -> str:
    """Return what a table says of the runs of one engine on one requirement."""
    counts = [run.simulations for run in runs]
    return f"{with_error(counts)} @ {sum(r.found for r in runs)}, {mean(r.thinking for r in runs):.3f} s"


def problems_of(folder: Path, systems: Sequence[str], *, free: bool) -> list[dict[str, Problem]]:
    """Return the problems of each spec file of a folder by name; of all files, or of the named systems."""
    used: Parameterization = "free" if free else "fixed"
    specs = {spec.stem: spec for spec in sorted(folder.glob("*.toml"))}
    if unknown := sorted(set(systems) - specs.keys()):
        sys.exit(f"{folder} has no system {', '.join(unknown)}; it has {', '.join(specs) or 'none'}")
    return [
        {
            f"{name} {requirement}": load_problem(f"{specs[name]}:{requirement}", parameterization=used)
            for requirement in tomllib.loads(specs[name].read_text("utf-8"))["requirements"]
        }
        for name in systems or specs
    ]


def compare(options: argparse.Namespace) -> None:
    """Print the table of engines, row by row."""
    columns = [f"`{name}`" for name in options.engines]
    columns += [f"psy-taliro, {name}" for name in PEERS if options.peer]
    print(f"| requirement | {' | '.join(columns)} |\n|{'---|' * (1 + len(columns))}")
    rows: list[list[list[Run]]] = []
    for problems in problems_of(options.folder, options.systems, free=options.free):
        for name, problem in problems.items():
            row = [
                [own(problem, engine, seed=seed, budget=options.budget) for seed in options.seeds]
                for engine in options.engines
            ]
            row += [
                [
                    peer(problem, other, options.peer, seed=seed, budget=options.budget)
                    for seed in options.seeds
                ]
                for other in PEERS
                if options.peer
            ]
            rows.append(row)
            print(f"| {name} | {' | '.join(map(cell, row))} |", flush=True)
    if rows:
        means = [mean(mean(r.simulations for r in row[i]) for row in rows) for i in range(len(columns))]
        print(f"| mean | {' | '.join(f'{value:.1f}' for value in means)} |")


def rates(options: argparse.Namespace) -> None:
    """Print how many of the same uniform samples violate each requirement."""
    print("| requirement | violated | one of | levels |\n|---|---|---|---|")
    for problems in problems_of(options.folder, options.systems, free=False):
        first, *_ = problems.values()
        values: dict[str, list[float]] = {name: [] for name in problems}
        for candidate in make_engine("uniform", first, seed=options.seeds[0]).ask(options.rates):
            evaluation = evaluate(first, candidate)
            for name, problem in problems.items():
                robustness = judge(problem, evaluation).robustness
                if robustness is not None:
                    values[name].append(robustness)
        for name, seen in values.items():
            count, levels = sum(value < 0 for value in seen), len(set(seen))
            often = f"{len(seen) / count:.0f}" if count else f"more than {len(seen)}"
            print(f"| {name} | {count} | {often} | {levels if levels < 50 else 'many'} |", flush=True)


def main() -> None:
    """Print one of the two tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with spec files")
    parser.add_argument("--engines", nargs="*", choices=sorted(set(ENGINES) - {"hybrid"}), default=COMPARED)
    parser.add_argument("--systems", nargs="+", default=(), metavar="NAME", help="default: all of the folder")
    parser.add_argument("--seeds", type=seeds_from, default=range(10), help="for example 0-9")
    parser.add_argument("--budget", type=int, default=300)
    parser.add_argument("--free", action="store_true", help="engines may choose control points")
    parser.add_argument("--peer", type=interpreter, help="interpreter that can import staliro")
    parser.add_argument("--rates", type=int, metavar="N", help="instead: judge N uniform samples")
    options = parser.parse_args()
    if options.rates:
        rates(options)
    else:
        compare(options)


if __name__ == "__main__":
    main()
