"""The order in which corners are tried: points at which every input is constant at a bound of its range."""

from math import inf

import numpy as np

Levels = tuple[int, ...]


class CornerWalk:
    """Walks through the corners of a box with one coordinate per input and parameter.

    The first corner is random. Each of the next ones flips one level of the best corner so far, that of the
    input flipped least often. If the effects of the inputs are additive, this reaches the best corner after
    one simulation per input; an input without effect costs one simulation instead of half of all corners.
    """

    def __init__(self, groups: int) -> None:
        self.groups = groups
        self._costs: dict[Levels, float] = {}
        self._flips = np.zeros(groups, dtype=int)

    def next(self, rng: np.random.Generator) -> Levels | None:
        """Return the next corner's levels (0 low, 1 high) and count it as tried; None if all have been."""
        if not self._costs:
            levels: Levels = tuple(int(v) for v in rng.integers(0, 2, self.groups))
            self._costs[levels] = inf
            return levels
        for base in sorted(self._costs, key=lambda levels: self._costs[levels]):
            flips = self._flips + rng.random(self.groups)
            for group in np.argsort(flips):
                levels = _flipped(base, int(group))
                if levels not in self._costs:
                    self._flips[group] += 1
                    self._costs[levels] = inf
                    return levels
        return None

    def learn(self, levels: Levels, cost: float | None) -> None:
        """Learn the cost of a corner; None if its simulation failed."""
        self._costs[levels] = inf if cost is None else cost

    def heard(self, levels: Levels, cost: float) -> None:
        """Learn the cost of a corner from a sample of someone else's, unless its own is known."""
        if self._costs.get(levels, inf) == inf:
            self._costs[levels] = cost

    @property
    def settled(self) -> bool:
        """Whether every single flip of the best corner has been tried, without an improvement."""
        if not self._costs:
            return False
        best = min(self._costs, key=lambda levels: self._costs[levels])
        return all(_flipped(best, group) in self._costs for group in range(self.groups))


def _flipped(levels: Levels, group: int) -> Levels:
    return (*levels[:group], 1 - levels[group], *levels[group + 1 :])
