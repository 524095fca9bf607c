"""Choice of the arm that proposes next, based on how its latest proposals rank among all costs."""

from collections.abc import Mapping, Sequence

import numpy as np

# Increase of an arm's probability per unit of quality: a quality 0.25 above the mean adds 0.5.
_SLOPE = 2.0


def quality(arm: str, arms: Sequence[str], costs: Sequence[float], *, window: int, power: float) -> float:
    """Return how good an arm's last proposals are, from 0 on; 0.5 if it has none.

    Each counts with the share of all costs that it improves on, raised to a power, because an arm that is
    usually bad and sometimes the best violates sooner than one that is always good. The mean is scaled so
    that ranks at random give 0.5.

    Args:
        arm: name of the arm.
        arms: name of the arm that proposed each simulation.
        costs: cost of each simulation.
        window: number of the arm's last proposals that count.
        power: the power, at least 1.
    """
    own = [i for i, engine in enumerate(arms) if engine == arm][-window:]
    if not own:
        return 0.5
    values = np.asarray(costs)
    shares = [np.mean(values > values[i]) + 0.5 * np.mean(values == values[i]) for i in own]
    return float(np.mean(np.power(shares, power)) * (power + 1) / 2)


def flatness(costs: Sequence[float]) -> float:
    """Return the share of costs that equal the most common one; near 1, costs do not lead a search."""
    if not costs:
        return 0.0
    _, counts = np.unique(np.asarray(costs), return_counts=True)
    return float(counts.max() / len(costs))


def has_lead(costs: Sequence[float]) -> bool:
    """Return whether a cost is lower than the most common one."""
    counts = np.unique(np.asarray(costs), return_counts=True)[1]
    return bool(counts.argmax() > 0)


def choose_arm(qualities: Mapping[str, float], rng: np.random.Generator, *, least: float) -> str:
    """Draw an arm; better ones are more likely, and each has a probability of about ``least`` or more."""
    names = list(qualities)
    values = np.array([qualities[name] for name in names])
    share = np.maximum(1 / len(names) + _SLOPE * (values - values.mean()), least)
    share = np.maximum(share / share.sum(), least)
    return names[int(rng.choice(len(names), p=share / share.sum()))]
