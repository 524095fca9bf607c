"""Exact bounds on a probability, from how often something happened in independent trials.

Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
Biometrika 26 (1934) 404-413. The bounds hold for every probability and every number of trials.
"""


def upper_bound(happened: int, trials: int, confidence: float) -> float:
    """Return the bound below which the probability lies with at least this confidence.

    >>> round(upper_bound(0, 300, 0.95), 5)
    0.00994
    """
    from scipy.stats import beta

    if happened >= trials:
        return 1.0
    return float(beta.ppf(confidence, happened + 1, trials - happened))


def lower_bound(happened: int, trials: int, confidence: float) -> float:
    """Return the bound above which the probability lies with at least this confidence."""
    from scipy.stats import beta

    if happened <= 0:
        return 0.0
    return float(beta.ppf(1.0 - confidence, happened, trials - happened + 1))


def interval(happened: int, trials: int, confidence: float) -> tuple[float, float]:
    """Return both bounds, between which the probability lies with at least this confidence."""
    each = (1.0 + confidence) / 2.0
    return lower_bound(happened, trials, each), upper_bound(happened, trials, each)
