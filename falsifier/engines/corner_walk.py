"""In which order corners are tried: where every input is constant at one end of its range."""

from math import inf

import numpy as np

Levels = tuple[int, ...]


class CornerWalk:
    """Walks through the corners of a box whose coordinates are whole inputs and parameters.

    The first corner is random. Then one level of the best corner so far is flipped, that of the input
    whose effect was looked at least often: where effects add up, the best corner is reached after one
    simulation per input, and an input without effect costs one simulation and not half of all corners.
    """

    def __init__(self, groups: int) -> None:
        self.groups = groups
        self._costs: dict[Levels, float] = {}
        self._flips = np.zeros(groups, dtype=int)

    def next(self, rng: np.random.Generator) -> Levels | None:
        """Levels (0 low, 1 high) of the next corner, which counts as tried; None when all were tried."""
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
        """Take note of what a corner costs; None where its simulation failed."""
        self._costs[levels] = inf if cost is None else cost

    @property
    def settled(self) -> bool:
        """Whether flipping any one level of the best corner was tried and made nothing better."""
        if not self._costs:
            return False
        best = min(self._costs, key=lambda levels: self._costs[levels])
        return all(_flipped(best, group) in self._costs for group in range(self.groups))


def _flipped(levels: Levels, group: int) -> Levels:
    return (*levels[:group], 1 - levels[group], *levels[group + 1 :])
