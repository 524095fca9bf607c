"""What does each part of the surrogate bring? The engine without it, on the same seeds.

    python bench/ablation.py                                             # free parameterization
    python bench/ablation.py --parameterization fixed --requirements AT52 AT53 AT6a CC3
    python bench/ablation.py --parts "the whole engine" "no trial of the dynamics" --requirements CC5

Each run ends at the first violation or after --budget simulations; the cells are their mean number. The
last column is the mean difference from the whole engine over all runs, with its standard error: it is
positive if the part helps. Violations are the monitor's and are not confirmed a second time.
"""

import argparse
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import patch

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from falsifier.engines.surrogate import policy, surrogate, variation
from falsifier.engines.surrogate.settings import Settings
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

REQUIREMENTS = ("AT1", "AT6a", "AT6b", "AT6c", "AT6abc", "NNx", "CC1", "CC3", "SC")


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
    priors = {other: rating for other, rating in surrogate._PRIORS.items() if other != arm}
    return Part(patches=[(surrogate, "_PRIORS", priors), (surrogate, "_PRIORS_OF_PARAMETERS", priors)])


PARTS = {
    "the whole engine": Part(),
    **{f"no {arm}": _without(arm) for arm in surrogate._PRIORS},
    "no constant ends of changes": Part(patches=[(variation, "_HELD", 0.0)]),
    "no steps towards bounds": Part({"bound_steps": 0}),
    "no switching inputs at all": Part({"bangs": 0}, [(surrogate, "_MOST_SWITCHING", 0)]),
    "no constants at first": Part({"constants": 0, "pauses": 0}),
    "no stepping inputs": Part({"probes": 0}),
    "no trial of the dynamics": Part({"trial": 0}),
    "nothing reserved": Part({"reserved": 0.0}),
    "ratings not sharpened": Part(patches=[(policy, "_SHARPNESS", 1.0)]),
    "half the population": Part({"pool": 250}),
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


def _with_error(numbers: Sequence[float], form: str = ".1f") -> str:
    error = np.std(numbers, ddof=1) / len(numbers) ** 0.5
    return f"{np.mean(numbers):{form}} ± {error:{form.lstrip('+')}}"


def main() -> None:
    """Print one line per part, as soon as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--requirements", nargs="+", default=REQUIREMENTS, metavar="NAME")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--parameterization", choices=["free", "fixed"], default="free")
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 109), metavar=("FIRST", "LAST"))
    parser.add_argument("--budget", type=int, default=60)
    options = parser.parse_args()
    names, seeds = options.requirements, range(options.seeds[0], options.seeds[1] + 1)
    problems = [load_problem(name, parameterization=options.parameterization) for name in names]
    print(f"| | {' | '.join(names)} | all | difference |\n|{'---|' * (len(names) + 3)}")
    whole = None
    for part in options.parts:
        with PARTS[part].off() as settings:
            counts = np.array([[count(p, settings, s, options.budget) for s in seeds] for p in problems])
        whole = counts if whole is None else whole
        cells = [*(_with_error(row) for row in counts), f"{counts.mean():.2f}"]
        difference = "–" if counts is whole else _with_error((counts - whole).ravel(), "+.2f")
        print(f"| {part} | {' | '.join(cells)} | {difference} |", flush=True)


if __name__ == "__main__":
    main()
