"""Can the fixed parameterization violate NNb, NNx and SC at all? The lowest robustness that optimisers reach.

The simulations are divided equally among uniform sampling, two optimisers of all control points at once and
an exchange of single ones that starts from random corners. Each ends early if it violates the requirement. A
requirement that none of them violates may still be violated somewhere: this is evidence, not a proof.

    python -m bench.fixed_space --simulations 100000
    python -m bench.fixed_space --requirements NNb --optimisers cma --simulations 5000
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from falsifier import load_problem, make_engine
from falsifier.core.candidate import Candidate
from falsifier.engines.layout import fixed_layout
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.fmu.model import FmuModel
from falsifier.problem.problem import Problem

Point = NDArray[np.float64]

REQUIREMENTS = {"NNb": "NN:NNb", "NNx": "NN:NNx", "SC": "SC:SC"}
ENGINES = ("uniform", "cma")
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)
# Time in s simulated beyond the formula's horizon; nothing later matters.
MARGIN = 0.2


class Ended(Exception):
    """An optimiser has no simulation left, or has violated the requirement."""


class Counter:
    """Simulates candidates, up to a number of them or the first violation; keeps the lowest robustness."""

    def __init__(self, problem: Problem, simulations: int) -> None:
        self.problem, self.simulations = problem, simulations
        self.box = fixed_layout(problem.space)
        self.used, self.failed, self.lowest = 0, 0, float("inf")
        self.best: Candidate | None = None
        interval = problem.experiment.output_interval
        end = problem.requirement.formula.horizon(interval) + MARGIN
        end = min(problem.experiment.stop_time, round(end / interval) * interval)
        assert isinstance(problem.model, FmuModel)
        self._short = replace(
            problem,
            space=replace(problem.space, stop_time=end),
            experiment=replace(problem.experiment, stop_time=end),
        )

    def simulate(self, candidate: Candidate) -> Evaluation:
        """Simulate a candidate whose control points lie in the whole stop time.

        Raises:
            Ended: if no simulation is left, or one has violated the requirement.
        """
        if self.used == self.simulations or self.lowest < 0.0:
            raise Ended
        self.used += 1
        result = evaluate(self._short, candidate)
        if result.robustness is None:
            self.failed += 1
        elif result.robustness < self.lowest:
            self.lowest, self.best = result.robustness, candidate
        return result

    def robustness(self, point: Point) -> float:
        """Return the robustness of a point in [0, 1]^d; a failed simulation counts as infinitely robust."""
        robustness = self.simulate(self.box.candidate(point, origin="bench", rationale="")).robustness
        return float("inf") if robustness is None else robustness


def ask_and_tell(counter: Counter, seed: int, *, name: str) -> None:
    """Ask an engine for one candidate after the other."""
    engine = make_engine(name, counter.problem, seed=seed)
    while True:
        engine.tell([counter.simulate(engine.ask()[0])])


def evolve(counter: Counter, seed: int) -> None:
    """Run scipy's differential evolution again and again, each time with another seed."""
    bounds = [(0.0, 1.0)] * counter.box.dimension
    while True:
        differential_evolution(
            counter.robustness, bounds, seed=np.random.default_rng(seed), maxiter=200, polish=False
        )
        seed += 1


def exchange(counter: Counter, seed: int) -> None:
    """From random corners, move one control point at a time to another of five levels until none helps."""
    rng = np.random.default_rng(seed)
    while True:
        point = rng.integers(0, 2, counter.box.dimension).astype(np.float64)
        best, improved = counter.robustness(point), True
        while improved:
            improved = False
            for changed in _neighbours(point, rng.permutation(counter.box.dimension)):
                if (value := counter.robustness(changed)) < best:
                    point, best, improved = changed, value, True
                    break


def _neighbours(point: Point, order: NDArray[np.int64]) -> Iterator[Point]:
    for i in order:
        for level in LEVELS:
            if level != point[i]:
                changed = point.copy()
                changed[i] = level
                yield changed


METHODS: dict[str, Callable[[Counter, int], None]] = {
    **{name: partial(ask_and_tell, name=name) for name in ENGINES},
    "differential evolution": evolve,
    "exchange of control points": exchange,
}


def main() -> None:
    """Print the table, row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--requirements", nargs="+", choices=sorted(REQUIREMENTS), default=sorted(REQUIREMENTS)
    )
    parser.add_argument("--optimisers", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--simulations", type=int, default=100_000, help="per requirement, by all optimisers")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print("| requirement | optimiser | simulations | failed | lowest robustness |\n|---|---|---|---|---|")
    for name in options.requirements:
        problem = load_problem(REQUIREMENTS[name], parameterization="fixed")
        for optimiser in options.optimisers:
            counter = Counter(problem, options.simulations // len(options.optimisers))
            with suppress(Ended):
                METHODS[optimiser](counter, options.seed)
            cells = (name, optimiser, str(counter.used), str(counter.failed), f"{counter.lowest:.5f}")
            print(f"| {' | '.join(cells)} |", flush=True)
            if counter.lowest < 0.0 and counter.best is not None:
                print(f"\nviolated by {dict(counter.best.signals)}\n", flush=True)


if __name__ == "__main__":
    main()
