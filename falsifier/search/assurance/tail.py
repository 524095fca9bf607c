"""The probability of a violation that extreme value theory extrapolates from the smallest robustness drawn.

Above a high threshold, exceedances of almost any distribution follow a generalized Pareto distribution
(Pickands, Statistical inference using extreme order statistics, Annals of Statistics 3 (1975) 119-131). It is
fitted by maximum likelihood; its interval is that of the profile likelihood of the probability itself (Coles,
An introduction to statistical modeling of extreme values, Springer 2001, section 4.3.3). How well it fits is
judged by the Cramer-von Mises statistic; its distribution comes from samples of the fitted distribution
(Choulakian and Stephens, Goodness-of-fit tests for the generalized Pareto distribution, Technometrics 43
(2001) 478-484), to which fits by probability-weighted moments suffice (Hosking and Wallis, Parameter and
quantile estimation for the generalized Pareto distribution, Technometrics 29 (1987) 339-349).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, hypot, log, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Share of the draws above the threshold, and the least number of them.
_SHARE, _FEWEST = 0.1, 20
# Shapes that are tried; below -1 the likelihood has no maximum.
_SHAPES = np.linspace(-0.999, 1.0, 51)
# Probabilities of going from the threshold to a violation that are tried, as powers of ten.
_POWERS = np.linspace(-9.0, 0.0, 91)
_SAMPLES = 500
# The likelihood's own intervals of 95 % hold in 89 % of cases if a tenth of 300 draws is above the threshold
# (bench/assurance.py): the distribution is only nearly right there. They are widened by this factor.
_CAUTION = 1.6


@dataclass(frozen=True, slots=True)
class Tail:
    """The estimated probability of a violation; an estimate, not a bound.

    Attributes:
        probability: estimated probability; 0 if the fitted distribution ends before a violation.
        low: lower end of the confidence interval.
        high: upper end of the confidence interval.
        points: number of draws from which it is estimated: those with the smallest robustness.
        fit: how probable a fit as poor as this one is, if the distribution is right; small: a poor fit.
    """

    probability: float
    low: float
    high: float
    points: int
    fit: float

    @property
    def is_poor(self) -> bool:
        """Whether the distribution does not fit, so that the estimate means nothing."""
        return self.fit < 0.05


def least_draws() -> int:
    """Return the number of draws with which a tail can be fitted."""
    return round(_FEWEST / _SHARE)


def tail(robustness: Sequence[float], *, confidence: float, seed: int) -> Tail | None:
    """Extrapolate the probability of a negative robustness from independent draws.

    Args:
        robustness: of each draw.
        confidence: confidence of the interval, such as 0.95.
        seed: seed of the samples that judge the fit.

    Returns:
        The estimate; None if there are too few draws, or too few different values.
    """
    values = np.sort(-np.asarray(robustness, dtype=np.float64))[::-1]
    count = int(len(values) * _SHARE)
    if count < _FEWEST:
        return None
    threshold = values[count]
    excess = values[:count] - threshold
    if len(np.unique(excess)) < count or threshold >= 0:  # steps, or violations that need no extrapolation
        return None
    scale = float(excess.mean())
    found = _profile(excess / scale, -float(threshold) / scale, confidence)
    share, width = count / len(values), _normal(confidence) * sqrt((1 - _SHARE) / count)
    best, low, high = found
    fit = _fit(excess / scale, np.random.default_rng(seed))
    if best == 0.0:
        return Tail(0.0, 0.0, min(1.0, share * high * exp(width)), count, fit)
    below = 0.0 if low == 0.0 else share * best * exp(-hypot(log(best / low), width))
    above = share * best * exp(hypot(log(high / best), width))
    return Tail(share * best, below, min(1.0, above), count, fit)


def _profile(excess: Array, distance: float, confidence: float) -> tuple[float, float, float]:
    """Return the likeliest probability of an excess above a distance, and its interval by the likelihood."""
    from scipy.stats import chi2

    probabilities = 10.0 ** _POWERS[:-1]
    likelihood = np.array([_likeliest(excess, distance, p) for p in probabilities])
    free = _likeliest_short(excess, distance)
    largest = max(float(likelihood.max()), free)
    allowed = _CAUTION * chi2.ppf(confidence, 1) / 2
    within = likelihood >= largest - allowed
    best = 0.0 if free >= likelihood.max() else float(probabilities[likelihood.argmax()])
    if not within.any():  # the smallest probability tried is too large already
        return 0.0, 0.0, float(probabilities[0])
    ends_before = free >= largest - allowed or within[0]
    return best, 0.0 if ends_before else float(probabilities[within][0]), float(probabilities[within][-1])


def _likeliest(excess: Array, distance: float, probability: float) -> float:
    """Return the largest logarithm of the likelihood with this probability of an excess above a distance."""
    shapes = np.where(np.abs(_SHAPES) < 1e-6, 1e-6, _SHAPES)
    scales = shapes * distance / (probability**-shapes - 1.0)
    return float(_likelihood(excess, shapes, scales).max())


def _likeliest_short(excess: Array, distance: float) -> float:
    """Return the same for distributions that end before the distance."""
    shapes = _SHAPES[_SHAPES < -1e-6]
    ends = np.linspace(float(excess.max()) * 1.0001, max(distance, float(excess.max()) * 1.0002), 30)
    ends = ends[ends <= distance]
    if not ends.size:
        return -np.inf
    pairs = np.array([(shape, -shape * end) for shape in shapes for end in ends])
    return float(_likelihood(excess, pairs[:, 0], pairs[:, 1]).max())


def _likelihood(excess: Array, shapes: Array, scales: Array) -> Array:
    """Return the logarithm of the likelihood for each pair of a shape and a scale, shape (k,)."""
    inside = 1.0 + shapes[:, np.newaxis] * excess / scales[:, np.newaxis]
    known = (inside > 0).all(axis=1)
    logs = np.log(np.where(inside > 0, inside, 1.0)).sum(axis=1)
    return np.where(known, -len(excess) * np.log(scales) - (1.0 + 1.0 / shapes) * logs, -np.inf)


def _fit(excess: Array, rng: np.random.Generator) -> float:
    """Return the share of samples of the fitted distribution that it fits no better."""
    shape, scale = _moments(excess[np.newaxis])
    uniform = rng.random((_SAMPLES, len(excess)))
    samples = scale * np.expm1(-shape * np.log1p(-uniform)) / shape
    return float((_distance(samples) >= _distance(excess[np.newaxis])).mean())


def _moments(samples: Array) -> tuple[Array, Array]:
    """Return shape and scale by probability-weighted moments for each row, shape (m, 1) each."""
    ordered = np.sort(samples, axis=1)
    n = samples.shape[1]
    weights = (n - np.arange(1, n + 1)) / (n - 1)
    first, second = ordered.mean(axis=1, keepdims=True), (weights * ordered).mean(axis=1, keepdims=True)
    shape = 2.0 - first / (first - 2.0 * second)
    scale = 2.0 * first * second / (first - 2.0 * second)
    return np.where(np.abs(shape) < 1e-9, 1e-9, shape), scale


def _distance(samples: Array) -> Array:
    """Return the Cramer-von Mises statistic of each row from the distribution fitted to it, shape (m,)."""
    shape, scale = _moments(samples)
    inside = np.maximum(1.0 + shape * np.sort(samples, axis=1) / scale, 1e-300)
    below = 1.0 - inside ** (-1.0 / shape)
    n = samples.shape[1]
    middles = (2 * np.arange(1, n + 1) - 1) / (2 * n)
    return np.asarray(((below - middles) ** 2).sum(axis=1) + 1 / (12 * n))


def _normal(confidence: float) -> float:
    from scipy.stats import norm

    return float(norm.ppf((1.0 + confidence) / 2.0))
