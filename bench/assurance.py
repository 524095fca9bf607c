"""Do the bounds and intervals of ``falsifier assess`` hold as often as they say?

The systems have known probabilities of a violation: their robustness is the distance of a sum of four
numbers, drawn uniformly from [0, 1], from its largest value (one corner) or from the nearer of its extremes
(two corners), less a constant. The probability of a sum above 4 - a is a^4 / 24 for a <= 1 (Irwin-Hall).

- bound: share of outcomes of 300 draws for which the exact upper bound is above the true probability. It is
  summed over all outcomes with their probabilities, so no simulation is needed.
- interval: share of 200 estimates by splitting, each with another seed and at most 4000 simulations, whose
  interval contains the true probability. Estimates that ran out of budget say so, and are counted apart.

- tail: share of 200 estimates by extreme value theory, each from 300 draws with another seed, whose interval
  contains the true probability, and of those whose fit is poor.

    python -m bench.assurance > bench/assurance.md
    python -m bench.assurance tail                     # only the second table
"""

import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import sqrt
from statistics import mean, median

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from falsifier import Splitting, Tail
from falsifier.search.assurance.bounds import upper_bound
from falsifier.search.assurance.splitting import split
from falsifier.search.assurance.tail import tail

# Others than those with which the intervals were developed.
SEEDS = range(1000, 1200)
DRAWN, SPLITTING = 300, 4000
PROBABILITIES = (1e-2, 1e-4, 1e-6)
CORNERS = {1: "one corner", 2: "two corners"}


def robustness(probability: float, corners: int) -> Callable[[NDArray[np.float64]], float]:
    """Return the robustness of a system that is violated with this probability."""
    distance = sqrt(sqrt(24.0 * probability / corners))

    def of(point: NDArray[np.float64]) -> float:
        total = float(point.sum())
        return (4.0 - total if corners == 1 else min(4.0 - total, total)) - distance

    return of


def estimated(probability: float, corners: int, seed: int) -> Splitting:
    """Estimate the probability of one system with one seed."""
    return split(robustness(probability, corners), 4, budget=SPLITTING, seed=seed, confidence=0.95)


def extrapolated(probability: float, corners: int, seed: int) -> Tail | None:
    """Extrapolate the probability of one system from draws with one seed."""
    cost = robustness(probability, corners)
    points = np.random.default_rng(seed).random((DRAWN, 4))
    return tail([cost(point) for point in points], confidence=0.95, seed=seed)


def print_tails() -> None:
    """Print the table of extreme value theory."""
    print("| system | probability | tail | poor fits | median estimate / truth | median high / truth |")
    print("|---|---|---|---|---|---|", flush=True)
    for corners, name in CORNERS.items():
        for probability in PROBABILITIES[:2]:
            found = [t for seed in SEEDS if (t := extrapolated(probability, corners, seed)) is not None]
            within = sum(t.low <= probability <= t.high for t in found) / len(found)
            poor = sum(t.is_poor for t in found) / len(found)
            ratio, high = (median(v / probability for v in each) for each in _columns(found))
            row_ = f"| {name} | {probability:.0e} | {within:.1%} | {poor:.1%} | {ratio:.2g} | {high:.2g} |"
            print(row_, flush=True)


def _columns(found: list[Tail]) -> tuple[list[float], list[float]]:
    return [t.probability for t in found], [t.high for t in found]


def main() -> None:
    """Print both tables."""
    if sys.argv[1:] == ["tail"]:
        print_tails()
        return
    print("# Coverage of bounds and intervals of 95 %\n")
    print("\n\n".join((__doc__ or "").split("\n\n")[1:3]))
    print("\nCommand: `python -m bench.assurance > bench/assurance.md`\n")
    print(
        "| system | probability | bound | interval | median estimate / truth | median high / low "
        "| mean simulations | unfinished |"
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    with ProcessPoolExecutor(2) as pool:
        for corners, name in CORNERS.items():
            for probability in PROBABILITIES:
                task = partial(estimated, probability, corners)
                print(row(name, probability, list(pool.map(task, SEEDS, chunksize=10))))
                sys.stdout.flush()
    print()
    print_tails()


def row(name: str, probability: float, found: list[Splitting]) -> str:
    """Return one row of the table."""
    finished = [s for s in found if s.probability is not None]
    within = sum(s.low <= probability <= s.high for s in finished)
    ratio = median(s.probability / probability for s in finished if s.probability is not None)
    return (
        f"| {name} | {probability:.0e} | {bound_coverage(probability):.1%} | {within / len(finished):.1%} "
        f"| {ratio:.2f} | {median(s.high / s.low for s in finished):.1f} "
        f"| {mean(s.simulations for s in found):.0f} | {len(found) - len(finished)} |"
    )


def bound_coverage(probability: float) -> float:
    """Return how probable it is that the exact bound holds."""
    outcomes = range(DRAWN + 1)
    holds = [upper_bound(k, DRAWN, 0.95) >= probability for k in outcomes]
    return float(sum(binom.pmf(k, DRAWN, probability) for k in outcomes if holds[k]))


if __name__ == "__main__":
    main()
