"""Whose turn it is: shares of turns by what each arm's latest proposals brought."""

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np

from falsifier.evaluation.levels import Levels

# What a new lowest robustness is worth at least; all the way to 0, it is worth 1.
_STEP_DOWN = 0.5
# What another new value among so many of the lowest different ones is worth; on a plateau there is none.
_NEAR, _LOWEST = 0.25, 5
# What something new that a discrete signal did is worth.
_NEW_MARK = 0.1
# Factor by which what an arm brought counts less with each of its later proposals.
_MEMORY = 0.9
# Power of the ratings to which the shares of turns are proportional.
_SHARPNESS = 3.0
# Number of proposals as which an arm's prior rating counts at first.
_PRIOR_WEIGHT = 2.0
# Rating of an arm of which nothing is known or remembered, and as how many proposals that always counts.
_UNKNOWN, _UNKNOWN_WEIGHT = 0.05, 1.0


def worth(levels: Levels, robustness: float) -> float:
    """Add a simulation to the levels; return from 0 to 1 what its robustness is worth."""
    lowest, place = levels.lowest, levels.add(robustness)
    if place is None:
        return 0.0
    if place == 0 and lowest < inf:
        way = 1.0 - max(robustness, 0.0) / lowest if lowest > 0.0 else 1.0
        return _STEP_DOWN + (1.0 - _STEP_DOWN) * way
    return _NEAR if 0 < place < _LOWEST else 0.0


class Policy:
    """Draws the arm that proposes next.

    A discounted rating with reserved shares: what an arm brought per proposal, of which older ones count
    less. ``design/search.md`` says what is proven of it.

    Args:
        priors: rating of each arm before its first proposals, from 0 to 1.
    """

    def __init__(self, priors: Mapping[str, float]) -> None:
        self._brought = {arm: _PRIOR_WEIGHT * prior for arm, prior in priors.items()}
        self._turns = dict.fromkeys(priors, _PRIOR_WEIGHT)

    def learn(self, arm: str, worth: float, *, is_new: bool) -> None:
        """Rate an arm by the worth of a proposal, and by whether a discrete signal did something new."""
        if arm in self._turns:
            self._brought[arm] = _MEMORY * self._brought[arm] + max(worth, _NEW_MARK * is_new)
            self._turns[arm] = _MEMORY * self._turns[arm] + 1.0

    def choose(self, arms: Sequence[str], reserved: Mapping[str, float], rng: np.random.Generator) -> str:
        """Draw one of the arms that can propose now.

        ``reserved`` are shares of the turns that no rating takes away, together less than 1; other arms have
        none.
        """
        kept = np.array([reserved.get(arm, 0.0) for arm in arms])
        brought, turns = (np.array([each[arm] for arm in arms]) for each in (self._brought, self._turns))
        ratings = ((brought + _UNKNOWN * _UNKNOWN_WEIGHT) / (turns + _UNKNOWN_WEIGHT)) ** _SHARPNESS
        shares = kept + (1.0 - kept.sum()) * ratings / ratings.sum()
        return arms[int(rng.choice(len(arms), p=shares / shares.sum()))]
