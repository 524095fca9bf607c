"""Who proposes next: every arm is judged by how its latest proposals rank among all costs."""

from collections.abc import Mapping, Sequence

import numpy as np

# How much a better rank raises an arm's probability: a quarter of the ranks is worth everything.
_SLOPE = 2.0


def quality(arm: str, arms: Sequence[str], costs: Sequence[float], *, window: int) -> float:
    """Mean share of all costs that an arm's last proposals were better than; 0.5 without any.

    Args:
        arm: which one.
        arms: who proposed each simulation.
        costs: of each simulation.
        window: how many of its last proposals count.
    """
    own = [i for i, engine in enumerate(arms) if engine == arm][-window:]
    if not own:
        return 0.5
    values = np.asarray(costs)
    shares = [np.mean(values > values[i]) + 0.5 * np.mean(values == values[i]) for i in own]
    return float(np.mean(shares))


def choose_arm(qualities: Mapping[str, float], rng: np.random.Generator, *, least: float) -> str:
    """Draw an arm, the better ones more often, none with a probability below ``least`` or so."""
    names = list(qualities)
    values = np.array([qualities[name] for name in names])
    share = np.maximum(1 / len(names) + _SLOPE * (values - values.mean()), least)
    share = np.maximum(share / share.sum(), least)
    return names[int(rng.choice(len(names), p=share / share.sum()))]
