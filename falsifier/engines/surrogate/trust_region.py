"""Search without dynamics: Bayesian optimisation in a box around the best point (a trust region)."""

from collections.abc import Callable

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.gaussian_process import fit_lengths, standardised
from falsifier.engines.surrogate.settings import Settings

# Side lengths of the box: initial, maximum, and the one below which another region starts. The first two are
# those of TuRBO (Eriksson et al., "Scalable Global Optimization via Local Bayesian Optimization", 2019).
_START_LENGTH = 0.8
_MAX_LENGTH = 1.6
_MIN_LENGTH = 0.5**5
_NOISE = 1e-3


class TrustRegion:
    """Proposes points in [0, 1]^d; grows after successes, shrinks after failures, ends once it is small."""

    def __init__(self, dimension: int, settings: Settings) -> None:
        self._dimension = dimension
        self._settings = settings
        self._points: list[Array] = []
        self._costs: list[float] = []
        self._asked = 0
        self._length = _START_LENGTH
        self._successes = self._failures = 0
        self._lengths = np.full(dimension, 0.35 * np.sqrt(dimension))

    @property
    def is_starting(self) -> bool:
        """Whether some of its first points have not been drawn yet."""
        return self._asked < self._settings.region_start

    @property
    def is_exhausted(self) -> bool:
        """Whether it has become so small that a new start is more promising."""
        return self._length < _MIN_LENGTH

    def ask(self, rng: np.random.Generator, risk: Callable[[Array], Array] | None = None) -> Array:
        """Return the next point, shape (d,).

        Args:
            rng: random generator.
            risk: returns from 0 to 1 how likely the simulations of points fail, shape (m,); None: none fails.
        """
        risk = risk or _no_risk
        self._asked += 1
        if self._asked <= self._settings.region_start or len(self._points) < 2:
            drawn = [self._first(rng)]
            while risk(drawn[-1][None])[0] > 0.0 and len(drawn) <= self._settings.retries:
                drawn.append(self._first(rng))
            return drawn[int(np.argmin(risk(np.array(drawn))))]
        points, costs = self._recent()
        process = fit_lengths(points, standardised(costs), self._lengths, rng, noise=_NOISE)
        self._lengths = process.lengths
        candidates = self._candidates(points[int(np.argmin(costs))], rng)
        mean, deviation = process.predict(candidates)
        # A lower confidence bound with a random factor balances exploitation and exploration.
        bound = mean - abs(rng.standard_normal()) * deviation
        return np.asarray(candidates[int(np.argmin(bound + self._settings.risk_weight * risk(candidates)))])

    def tell(self, point: Array, cost: float) -> None:
        """Learn the cost of a point."""
        best = min(self._costs, default=np.inf)
        self._points.append(point)
        self._costs.append(cost)
        if len(self._points) <= self._settings.region_start:
            return
        if cost < best - 1e-3 * abs(best):
            self._successes, self._failures = self._successes + 1, 0
        else:
            self._successes, self._failures = 0, self._failures + 1
        if self._successes >= 3:
            self._length, self._successes = min(_MAX_LENGTH, 2 * self._length), 0
        if self._failures >= max(4, self._dimension // 2):
            self._length, self._failures = self._length / 2, 0

    def _first(self, rng: np.random.Generator) -> Array:
        """Return a random point, many of its coordinates at bounds."""
        point = rng.random(self._dimension)
        at_bound = rng.random(self._dimension) < self._settings.region_bound_start
        return np.where(at_bound, np.round(point), point)

    def _recent(self) -> tuple[Array, Array]:
        """Return the points and costs for the process: the latest ones and the best one."""
        keep = list(range(max(0, len(self._costs) - self._settings.region_points), len(self._costs)))
        best = int(np.argmin(self._costs))
        if best not in keep:
            keep.append(best)
        return np.array([self._points[i] for i in keep]), np.array([self._costs[i] for i in keep])

    def _candidates(self, best: Array, rng: np.random.Generator) -> Array:
        """Return points around the best that differ from it in some coordinates, many of these at bounds."""
        settings, d = self._settings, self._dimension
        shape = (settings.region_candidates, d)
        reach = self._lengths / np.exp(np.mean(np.log(self._lengths))) * self._length / 2
        low, high = np.clip(best - reach, 0.0, 1.0), np.clip(best + reach, 0.0, 1.0)
        changed = rng.random(shape) < min(1.0, max(0.2, 8 / d))
        changed[np.arange(shape[0]), rng.integers(0, d, shape[0])] = True
        points = np.where(changed, low + (high - low) * rng.random(shape), best)
        to_bound = changed & (rng.random(shape) < settings.region_bound)
        points = np.where(to_bound, np.round(points), points)
        jump = changed & (rng.random(shape) < settings.region_jump)
        return np.where(jump, rng.random(shape), points)


def _no_risk(points: Array) -> Array:
    return np.zeros(len(points))
