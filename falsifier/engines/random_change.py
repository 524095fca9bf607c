"""What is simulated if a language model gives no valid reply: a random change of the best sample."""

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace

# Share of the numbers that change, and the standard deviation of a change as a share of the range.
_SHARE = 0.3
_DEVIATION = 0.25


def random_change(space: SearchSpace, best: Candidate | None, *, seed: tuple[int, ...]) -> Candidate:
    """Return a candidate within the search space.

    Args:
        space: search space.
        best: what is changed, in at least one number; None: a point is drawn from the whole space.
        seed: the same numbers give the same candidate.
    """
    rng = np.random.default_rng(seed)
    low = np.array([d.low for d in space.dimensions])
    high = np.array([d.high for d in space.dimensions])
    if best is None:
        return space.decode(low + rng.random(len(low)) * (high - low))
    changed = rng.random(len(low)) < _SHARE
    changed[rng.integers(len(low))] = True
    noise = np.where(changed, rng.normal(0.0, _DEVIATION, len(low)) * (high - low), 0.0)
    old = space.encode(best)
    is_inside = (low <= old + noise) & (old + noise <= high)
    # A step across a limit is taken the other way, or a number at its limit would often not change at all.
    return space.decode(np.clip(np.where(is_inside, old + noise, old - noise), low, high))
