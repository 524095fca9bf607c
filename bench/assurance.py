"""Do the bounds and intervals of ``falsifier assess`` hold as often as they say?

Each system is a model whose inputs are four parameters, drawn uniformly from [0, 1], with a known probability
of a violation:

- one corner, two corners: the robustness is the distance of the sum from its largest value (or from the
  nearer of its extremes), less a constant. The probability of a sum above 4 - a is a^4 / 24 for a <= 1
  (Irwin-Hall);
- rare mode: one number has to be large, and increased by a jump of probability 0.02;
- narrow: one parameter lies in an interval; beside it the robustness is the same everywhere;
- narrow, slope aside: the same, and the robustness falls in another direction, to no violation;
- narrow, slope to others: the same, and the robustness falls to other violations, of probability 2e-4.

The columns:

- bound, interval: share of 1000 calls of `assess`, each with another seed and 300 draws, in which the exact
  upper bound, and the exact two-sided interval, contain the true probability.

    python -m bench.assurance > bench/assurance.md
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import sqrt
from statistics import mean

import numpy as np
from numpy.typing import NDArray

from bench.example_systems import function_problem
from falsifier import ParameterRange, Problem, assess

Cost = Callable[[NDArray[np.float64]], float]

SEEDS = range(1000, 2000)
DRAWN = 300
_NAMES = ("a", "b", "c", "d")
# Probability of the rare mode, and of the violations to which a slope leads.
_RARE, _BROAD = 0.02, 2e-4
# Where the narrow intervals begin: neither at an end nor in the middle.
_NARROW = 0.37


def corners(probability: float, *, count: int) -> Cost:
    """The sum of all numbers is near its largest value, or near one of its extremes."""
    distance = sqrt(sqrt(24.0 * probability / count))

    def of(point: NDArray[np.float64]) -> float:
        total = float(point.sum())
        return (4.0 - total if count == 1 else min(4.0 - total, total)) - distance

    return of


def rare_mode(probability: float) -> Cost:
    """Two distributions, of which the rare one alone violates."""
    threshold = 2.0 - probability / _RARE
    return lambda point: threshold - float(point[0]) - float(point[1] < _RARE)


def narrow(probability: float, *, slope: float = 0.0, others: float = 0.0) -> Cost:
    """A narrow interval of one parameter violates; beside it a slope leads elsewhere.

    Args:
        probability: of all violations together.
        slope: by how much the robustness falls over the range of another parameter.
        others: probability of the violations to which the slope leads; 0: it leads to none.
    """
    width = (probability - others) / (1.0 - others)

    def of(point: NDArray[np.float64]) -> float:
        if _NARROW <= point[0] < _NARROW + width:
            return -1.0
        if others:
            return float(2.0 - point[1] - point[2]) - sqrt(2.0 * others)
        return 1.0 + slope * float(1.0 - point[1])

    return of


SYSTEMS: dict[str, Callable[[float], Cost]] = {
    "one corner": partial(corners, count=1),
    "two corners": partial(corners, count=2),
    "rare mode": rare_mode,
    "narrow": narrow,
    "narrow, slope aside": partial(narrow, slope=1.0),
    "narrow, slope to others": partial(narrow, others=_BROAD),
}
# Between which a system is what its name says: probability of the rare mode, of the other violations, and of
# a sum so large that its formula is another one.
LARGEST, SMALLEST = (
    {"rare mode": _RARE, "one corner": 0.04, "two corners": 0.08},
    {"narrow, slope to others": _BROAD},
)
PROBABILITIES = (1e-1, 1e-2, 1e-3, 1e-4)


def problem_of(cost: Cost) -> Problem:
    """Return a problem whose robustness is a cost of its four parameters."""

    def respond(
        times: NDArray[np.float64], _: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]
    ) -> dict[str, NDArray[np.float64]]:
        return {"y": np.full(times.shape, cost(np.array([values[name] for name in _NAMES])))}

    parameters = tuple(ParameterRange(name, 0.0, 1.0) for name in _NAMES)
    return function_problem(respond, "y >= 0", (), parameters, {"y": "real"}, 1.0, 1.0)


def exact(name: str, probability: float, seed: int) -> tuple[bool, bool]:
    """Whether the bound, and whether the interval, contain the probability."""
    found = assess(problem_of(SYSTEMS[name](probability)), budget=DRAWN, seed=seed)
    low, high = found.interval
    return probability <= found.bound, low <= probability <= high


def row(pool: ProcessPoolExecutor, name: str, probability: float) -> str:
    """Return one row of the table."""
    told = list(pool.map(partial(exact, name, probability), SEEDS, chunksize=10))
    exactly = " | ".join(f"{mean(held):.1%}" for held in zip(*told, strict=True))
    return f"| {name} | {probability:.0e} | {exactly} |"


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    print("# Coverage of bounds and intervals of 95 %\n")
    print("\n\n".join((__doc__ or "").split("\n\n")[1:-1]))
    print("\nCommand: `python -m bench.assurance > bench/assurance.md`\n")
    print("| system | probability | bound | interval |")
    print("|---|---|---|---|", flush=True)
    with ProcessPoolExecutor(2) as pool:
        for name in SYSTEMS:
            for probability in PROBABILITIES:
                if probability < LARGEST.get(name, 1.0) and probability > SMALLEST.get(name, 0.0):
                    print(row(pool, name, probability))
                    sys.stdout.flush()


if __name__ == "__main__":
    main()
