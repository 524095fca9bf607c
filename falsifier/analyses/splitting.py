"""Adaptive multilevel splitting: estimates probabilities that are too small for plain sampling.

A population of points is drawn at random. Again and again the point with the largest cost is replaced by a
copy of another one, which is moved at random as long as its cost stays below that of the replaced point. The
number of replacements until all costs are negative says how small the probability of that is. Method:
Cerou and Guyader, Adaptive multilevel splitting for rare event analysis, Stochastic Analysis and Applications
25 (2007) 417-443; replacement of the last point and its variance: Guyader, Hengartner and Matzner-Lober,
Simulation and estimation of extreme quantiles and extreme probabilities, Applied Mathematics and
Optimization 64 (2011) 171-196; moves that keep the normal distribution: Cotter, Roberts, Stuart and White,
MCMC methods for functions, Statistical Science 28 (2013) 424-446.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, hypot, log, log1p, sqrt

import numpy as np
from numpy.typing import NDArray

Point = NDArray[np.float64]
Cost = Callable[[Point], float]

# Independent populations: how much they differ shows what the theory of one population leaves out.
_POPULATIONS = 4
# Moves of a copy: fewer leave it close to the original, more cost simulations.
_MOVES = 5
_FEWEST_POINTS = 10
_MOST_POINTS = 200
# The number of points is chosen so that the budget suffices down to this probability.
_SMALLEST = 1e-8
# Moves are made longer after each success and shorter after each failure, so that about 30 % succeed.
_LONGER, _SHORTER = 1.03, 0.987
_LONGEST, _SHORTEST = 1.0, 0.02


@dataclass(frozen=True, slots=True)
class Splitting:
    """An estimate of a small probability, not a bound: it misses violations to which no slope leads.

    If the budget ended before all costs were negative, there is no estimate: that a population stopped at
    some cost says nothing about the probability of violations beside its slope.

    Attributes:
        probability: estimated probability; None if the budget ended before.
        low: lower end of the confidence interval; 0 without an estimate.
        high: upper end of the confidence interval; 1 without an estimate.
        simulations: number of costs that were calculated.
        points: number of points in each population.
    """

    probability: float | None
    low: float
    high: float
    simulations: int
    points: int


@dataclass(frozen=True, slots=True)
class _Population:
    """One population at its end: logarithm of the probability, and its variance."""

    logarithm: float
    variance: float
    simulations: int
    complete: bool


def least_budget() -> int:
    """Return the number of simulations with which the smallest probabilities can be estimated."""
    return round(_POPULATIONS * _FEWEST_POINTS * (1 + _MOVES * log(1 / _SMALLEST)))


def split(cost: Cost, dimension: int, *, budget: int, seed: int, confidence: float) -> Splitting:
    """Estimate the probability that the cost of a random point is negative.

    Args:
        cost: cost of a point in [0, 1]^d, shape (d,); infinite if it is not known.
        dimension: number of coordinates d of a point.
        budget: maximum number of costs to calculate.
        seed: seed of the random numbers.
        confidence: confidence of the interval, such as 0.95.
    """
    each = budget // _POPULATIONS
    points = round(each / (1 + _MOVES * log(1 / _SMALLEST)))
    points = min(max(points, _FEWEST_POINTS), _MOST_POINTS)
    ended = [
        _population(cost, dimension, points, each, np.random.default_rng([seed, i]))
        for i in range(_POPULATIONS)
    ]
    simulations = sum(p.simulations for p in ended)
    if not all(p.complete for p in ended):
        return Splitting(None, 0.0, 1.0, simulations, points)
    middle = log(sum(exp(p.logarithm) for p in ended) / len(ended))
    error = _error(ended, confidence)
    return Splitting(exp(middle), exp(middle - error), min(1.0, exp(middle + error)), simulations, points)


def _error(ended: list[_Population], confidence: float) -> float:
    """Return half the width of the logarithm's interval: the theory's and what is seen, added as variances.

    The theory assumes copies that are independent after their moves; four populations alone say little about
    their spread. Either alone gives intervals that hold too rarely (bench/assurance.py).
    """
    from scipy.special import ndtri, stdtrit

    count, each = len(ended), (1 + confidence) / 2
    theory = sqrt(sum(p.variance for p in ended)) / count
    seen = float(np.std([p.logarithm for p in ended], ddof=1)) / sqrt(count)
    return hypot(float(ndtri(each)) * theory, float(stdtrit(count - 1, each)) * seen)


def _population(
    cost: Cost, dimension: int, points: int, budget: int, rng: np.random.Generator
) -> _Population:
    """Move one population until all its costs are negative or the budget is used up."""
    from scipy.special import ndtr

    states = rng.standard_normal((points, dimension))
    costs = np.array([cost(ndtr(state)) for state in states])
    logarithm = variance = 0.0
    simulations, length = points, 0.8
    while (level := float(costs.max())) >= 0.0:
        last = np.flatnonzero(costs >= level)
        others = np.flatnonzero(costs < level)
        if not others.size or simulations + last.size * _MOVES > budget:
            return _Population(logarithm, variance, simulations, complete=False)
        logarithm += log1p(-last.size / points)
        variance += last.size / (points * others.size)
        for i in last:
            j = rng.choice(others)
            state, value = states[j], costs[j]
            for _ in range(_MOVES):
                moved = sqrt(1.0 - length**2) * state + length * rng.standard_normal(dimension)
                new = cost(ndtr(moved))
                if new < level:
                    state, value = moved, new
                length = min(length * _LONGER, _LONGEST) if new < level else max(length * _SHORTER, _SHORTEST)
            states[i], costs[i] = state, value
        simulations += last.size * _MOVES
    return _Population(logarithm, variance, simulations, complete=True)
