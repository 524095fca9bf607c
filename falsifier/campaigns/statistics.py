"""Statistics of the competition's protocol, for the runs of one method on one requirement."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.request import Method
from falsifier.campaigns.runs import RunProgress
from falsifier.search.budget import Spent

_CONFIDENCE = 0.95
_RESAMPLES = 2000
# Fewer runs say so little that an interval would look like more.
_FEWEST_RUNS = 5
# What of a request is no setting of the search, or is told apart otherwise.
_NO_SETTINGS: Any = {
    **dict.fromkeys(("engine", "seed", "budget", "jobs", "keep", "start_from"), True),
    "problems": {"__all__": {"target", "record", "parameterization"}},
    "llm": {"cache", "timeout", "price"},
}
Interval = tuple[float, float]
R = TypeVar("R", bound=RunProgress)


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of several runs.

    All but ``unfinished_runs``, ``smallest_robustness`` and ``budgets`` are of finished runs; the tables say
    which these are.

    Attributes:
        runs: number of finished runs.
        falsified_runs: number of runs with a confirmed counterexample.
        unfinished_runs: number of runs that ended before, are still running, or have not begun.
        mean: mean number of simulations over the falsified runs; None if there is none.
        median: median of the same.
        deviation: sample standard deviation of the same; None below two falsified runs.
        rate_interval: 95 % Wilson interval of the share of falsified runs; None below five finished runs.
        mean_interval: 95 % percentile bootstrap interval of the mean; None below five falsified runs.
        smallest_robustness: smallest robustness of any run, without violations that were not confirmed.
        spent: what the runs have spent together.
        budgets: the different limits on the simulations of a run, in ascending order.
        known: number of runs that began with known inputs.
        repeated: number of runs without a language model that have the seed of another one: nothing new.
        settings: number of different settings (ranges, options, context files) of the runs.
    """

    runs: int
    falsified_runs: int
    unfinished_runs: int
    mean: float | None
    median: float | None
    deviation: float | None
    rate_interval: Interval | None
    mean_interval: Interval | None
    smallest_robustness: float | None
    spent: Spent
    budgets: tuple[int, ...]
    known: int
    repeated: int
    settings: int


def statistics(runs: Iterable[RunProgress]) -> Statistics:
    """Compute the statistics of runs of one method on one requirement."""
    runs = list(runs)
    finished = [run for run in runs if run.counts]
    counts = np.array([run.simulations for run in finished if run.falsified], dtype=np.float64)
    seeds = [run.seed for run in finished if not run.method.llm]
    return Statistics(
        runs=len(finished),
        falsified_runs=len(counts),
        unfinished_runs=len(runs) - len(finished),
        mean=float(counts.mean()) if counts.size else None,
        median=float(np.median(counts)) if counts.size else None,
        deviation=float(counts.std(ddof=1)) if counts.size > 1 else None,
        rate_interval=wilson(len(counts), len(finished)) if len(finished) >= _FEWEST_RUNS else None,
        mean_interval=bootstrap(counts) if counts.size >= _FEWEST_RUNS else None,
        smallest_robustness=min((r for run in runs if (r := run.best_robustness) is not None), default=None),
        spent=sum((run.spent for run in finished), Spent()),
        budgets=tuple(sorted({limit for run in runs if (limit := run.request.budget.simulations)})),
        known=sum(bool(run.request.start_from) for run in finished),
        repeated=len(seeds) - len(set(seeds)),
        settings=len({run.request.model_dump_json(exclude=_NO_SETTINGS) for run in finished}),
    )


def group(runs: Iterable[R]) -> dict[tuple[str, Method], list[R]]:
    """Runs by requirement and method, in order of first appearance."""
    groups: dict[tuple[str, Method], list[R]] = {}
    for run in runs:
        groups.setdefault((run.requirement, run.method), []).append(run)
    return groups


def wilson(successes: int, trials: int) -> Interval:
    """95 % score interval of a share (E. B. Wilson, 1927): not empty for shares of 0 and 1, either.

    >>> low, high = wilson(10, 10)
    >>> round(low, 4), high
    (0.7225, 1.0)
    """
    from scipy.stats import binomtest

    low, high = binomtest(successes, trials).proportion_ci(_CONFIDENCE, method="wilson")
    return float(low), float(high)


def bootstrap(values: NDArray[np.float64]) -> Interval:
    """95 % percentile bootstrap interval of the mean; seeded, so the same values give the same interval."""
    draws = np.random.default_rng(0).choice(values, size=(_RESAMPLES, len(values)))
    tail = 50 * (1 - _CONFIDENCE)
    low, high = np.percentile(draws.mean(axis=1), [tail, 100 - tail])
    return float(low), float(high)
