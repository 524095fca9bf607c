"""What does each part of the surrogate bring? The engine without it, on the same seeds.

    python bench/ablation.py                                             # free parameterization
    python bench/ablation.py --parameterization fixed --requirements AT52 AT53 AT6a CC3
    python bench/ablation.py --requirements CC4 CC5 CCx --budget 400 --without "no automaton"
    python bench/ablation.py --parts "the whole engine" "no offsets" --requirements CC5

Each run ends at the first violation or after --budget simulations; the cells are their mean number. The
last column is the mean difference from the whole engine over all runs, with its standard error: it is
positive if the part helps. With --without PART, that part is off in all rows. Violations are the monitor's
and are not confirmed a second time.
"""

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any
from unittest.mock import patch

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.layout import Layout
from falsifier.engines.surrogate import direct, forecast, history, planning, surrogate, trace
from falsifier.engines.surrogate.automaton import predictions
from falsifier.engines.surrogate.coordinates import Coordinates
from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.variation import mutations, random_points
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

    def __add__(self, other: "Part") -> "Part":
        """Both at once."""
        return Part({**self.settings, **other.settings}, [*self.patches, *other.patches])

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


def _without_envelopes(*arguments: Any) -> trace.Trace:
    made = trace.trace_of(*arguments)
    return replace(made, excess=np.zeros_like(made.excess))


def _without_differences(_: Any, outputs: Sequence[str], *__: Any) -> Coordinates:
    return Coordinates(tuple(outputs))


def _uncritical(*arguments: Any, **_: Any) -> Any:
    return _MUTATIONS(*arguments)


def _random(layout: Layout, rng: np.random.Generator, *_: Any) -> Array:
    return np.asarray(random_points(layout, rng, 1)[0])


def _only(arm: str) -> Callable[..., str]:
    return lambda *_, **__: arm


def _without_kind(name: str) -> Part:
    kinds = {other: kind for other, kind in forecast._KINDS.items() if other != name}
    return Part(patches=[(forecast, "_KINDS", kinds)])


_MUTATIONS = mutations

PARTS = {
    "the whole engine": Part(),
    "no automaton": Part(patches=[(predictions, "learn", lambda *_: None)]),
    "no direct search": Part({"trusted_share": 1.0}, [(surrogate, "choose_arm", _only("dynamics"))]),
    "no dynamics": Part(
        {"trial_share": 0.0, "trusted_error": 0.0}, [(surrogate, "choose_arm", _only("direct"))]
    ),
    "no rounds of the direct search": Part({"direct_patience": 10**9}),
    "no constant ends in the direct search": Part({"direct_held": 0.0}),
    "independent instead of common pieces in the direct search": Part(patches=[(direct, "paced", _random)]),
    "arms rated by mean ranks": Part({"bandit_power": 1.0}),
    "no linear dynamics": _without_kind("linear"),
    "no nonlinear dynamics": _without_kind("nonlinear"),
    "no dynamics with modes": _without_kind("switched"),
    "best trajectories weigh as much as others": Part({"best_weight": 0.0}),
    "never the worse dynamics": Part({"exploration": 0.0}),
    "no offsets": Part({"offset_limit": 0.0}),
    "no envelopes": Part(patches=[(history, "trace_of", _without_envelopes)]),
    "no differences of outputs": Part(patches=[(history, "choose_coordinates", _without_differences)]),
    "no liking for extremes": Part({"snap": -np.inf}),
    "a liking for extremes that stays": Part({"snap_decay": 1.0}),
    "no steps towards bounds": Part({"vertex_steps": 0}),
    "critical times not used": Part(patches=[(planning, "mutations", _uncritical)]),
    "no switching inputs": Part({"bangs": 0, "most_bangs": 0}),
    "no constants at first": Part({"constants": 0}),
    "no stepping inputs": Part({"probes": 0}),
    "no trial of the dynamics": Part({"trial_share": 0.0}),
    "no trust in dynamics": Part({"trusted_error": 0.0}),
    "no coverage": Part({"coverage_share": 0.0}),
    "no stretched windows": Part({"stretches": (1.0,)}),
    "64 features instead of 128": Part({"features": 64}),
    "half the population": Part({"pool": 300, "children": 150}),
    "half the rows": Part({"most_rows": 3000}),
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
    parser.add_argument("--without", choices=PARTS, default="the whole engine", metavar="PART")
    parser.add_argument("--parameterization", choices=["free", "fixed"], default="free")
    parser.add_argument("--seeds", type=int, nargs=2, default=(100, 109), metavar=("FIRST", "LAST"))
    parser.add_argument("--budget", type=int, default=60)
    options = parser.parse_args()
    names, seeds = options.requirements, range(options.seeds[0], options.seeds[1] + 1)
    problems = [load_problem(name, parameterization=options.parameterization) for name in names]
    print(f"| | {' | '.join(names)} | all | difference |\n|{'---|' * (len(names) + 3)}")
    whole = None
    for part in options.parts:
        with (PARTS[options.without] + PARTS[part]).off() as settings:
            counts = np.array([[count(p, settings, s, options.budget) for s in seeds] for p in problems])
        whole = counts if whole is None else whole
        cells = [*(_with_error(row) for row in counts), f"{counts.mean():.2f}"]
        difference = "–" if counts is whole else _with_error((counts - whole).ravel(), "+.2f")
        print(f"| {part} | {' | '.join(cells)} | {difference} |", flush=True)


if __name__ == "__main__":
    main()
