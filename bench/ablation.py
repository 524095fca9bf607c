"""What does each part of the surrogate bring? The engine without it, on the same systems and seeds.

    python -m bench.ablation
    python -m bench.ablation --groups published --parts "the whole engine" "no dynamics" --seeds 0-9

The groups of requirements are some of the benchmark's, with free inputs, and the functions of this folder.
Each run ends at the first violation or after --budget simulations, a miss counted as the budget; violations
are the monitor's and are not confirmed a second time. The first row has the geometric mean of the numbers of
simulations, each other one the mean difference of their logarithms from the first row, run by run, with its
standard error: 0.05 is 5 % more simulations without the part.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any
from unittest.mock import patch

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench import function_mixed, function_plants, function_systems
from bench.search import seeds_from
from falsifier.engines.surrogate import policy, surrogate
from falsifier.engines.surrogate.settings import Settings
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

PUBLISHED = ("AT1", "AT6a", "AT6b", "AT6c", "AT6abc", "NNx", "CC1", "CC3", "SC")
GROUPS: dict[str, Mapping[str, Callable[[], Problem]]] = {
    "published": {name: partial(load_problem, name) for name in PUBLISHED},
    "functions": function_systems.PROBLEMS,
    "plants": function_plants.PROBLEMS,
    "mixed": function_mixed.PROBLEMS,
}


@dataclass(frozen=True)
class Part:
    """What is switched off.

    Attributes:
        settings: settings that differ.
        patches: module, name and replacement of functions.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    patches: Sequence[tuple[Any, str, Any]] = ()

    @contextmanager
    def off(self) -> Iterator[Settings]:
        """Switch it off."""
        running = [patch.object(*arguments) for arguments in self.patches]
        for one in running:
            one.start()
        try:
            yield replace(Settings(), **self.settings)
        finally:
            for one in running:
                one.stop()


def _without(arm: str) -> Part:
    def left(ratings: Mapping[str, float]) -> dict[str, float]:
        return {other: rating for other, rating in ratings.items() if other != arm}

    names = ("_PRIORS", "_PRIORS_OF_PARAMETERS")
    return Part(patches=[(surrogate, name, left(getattr(surrogate, name))) for name in names])


PARTS = {
    "the whole engine": Part(),
    **{f"no {arm}": _without(arm) for arm in surrogate._PRIORS if arm != "context"},  # there are no files
    "no steps towards bounds": Part({"bound_steps": 0}),
    "no switching inputs at all": Part({"bangs": 0}, [(surrogate, "_MOST_SWITCHING", 0)]),
    "no constants at first": Part({"constants": 0, "pauses": 0}),
    "no stepping inputs": Part({"probes": 0}),
    "no trial of the dynamics": Part({"trial": 0}),
    "nothing reserved": Part({"reserved": 0.0}),
    "ratings not sharpened": Part(patches=[(policy, "_SHARPNESS", 1.0)]),
}


def count(problem: Problem, settings: Settings, seed: int, budget: int) -> int:
    """Simulations until the first violation, at most the budget."""
    engine = surrogate.Surrogate(problem, seed=seed, settings=settings)
    for number in range(1, budget + 1):
        (candidate,) = engine.ask(1)
        evaluation = evaluate(problem, candidate)
        if evaluation.robustness is not None and evaluation.robustness < 0:
            return number
        engine.tell([evaluation])
    return budget


def main() -> None:
    """Print one line per part, as soon as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--groups", nargs="+", choices=GROUPS, default=list(GROUPS), metavar="GROUP")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--seeds", type=seeds_from, default=range(6000, 6001), help="for example 0-9")
    parser.add_argument("--budget", type=int, default=100)
    options = parser.parse_args()
    problems = {group: [make() for make in GROUPS[group].values()] for group in options.groups}
    print(f"| | {' | '.join(options.groups)} |\n|{'---|' * (len(options.groups) + 1)}")
    whole: dict[str, Any] = {}
    for part in options.parts:
        cells = []
        for group in options.groups:
            with PARTS[part].off() as settings:
                runs = [count(p, settings, s, options.budget) for p in problems[group] for s in options.seeds]
            logs = np.log(runs)
            if group in whole:
                change = logs - whole[group]
                error = change.std(ddof=1) / len(runs) ** 0.5
                cells.append(f"{change.mean():+.2f} ± {error:.2f}" if change.any() else "0")
            else:
                whole[group] = logs
                cells.append(f"{np.exp(logs.mean()):.1f}")
        print(f"| {part} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
