from pathlib import Path

import numpy as np
import pytest

from falsifier.campaigns.analysis import load, statistics
from falsifier.campaigns.statistics import bootstrap, wilson


def test_bootstrap_interval_holds_the_mean_and_repeats() -> None:
    values = np.array([1.0, 2.0, 4.0, 8.0, 100.0])
    low, high = bootstrap(values)
    assert 1.0 < low < values.mean() < high < 100.0
    assert bootstrap(values) == (low, high)
    assert bootstrap(np.array([3.0, 3.0])) == (3.0, 3.0)


def test_statistics_are_over_the_falsified_runs(campaign: Path) -> None:
    runs = [run for run in load(campaign) if run.requirement == "HARD" and run.method.engine == "uniform"]
    found = statistics(runs)
    counts = [run.simulations for run in runs if run.falsified]
    assert (found.runs, found.falsified_runs) == (2, len(counts)) == (2, 2)
    assert found.mean == np.mean(counts) and found.median == np.median(counts)
    assert found.deviation == pytest.approx(np.std(counts, ddof=1))
    assert found.spent.cost == 0
    assert found.smallest_robustness == min(run.verdict.robustness for run in runs if run.verdict)


def test_without_a_falsified_run_there_is_no_mean(campaign: Path) -> None:
    found = statistics(run for run in load(campaign) if run.requirement == "NEVER")
    assert (found.runs, found.falsified_runs) == (4, 0)
    assert (found.mean, found.median, found.deviation, found.mean_interval) == (None, None, None, None)
    assert found.rate_interval is None, "four runs are too few for an interval"


def test_from_five_runs_on_there_are_intervals(campaign: Path) -> None:
    runs = [run for run in load(campaign) if run.requirement == "HARD"] * 2
    found = statistics(runs[:5])
    assert found.rate_interval == wilson(5, 5)
    assert found.mean_interval is not None
    assert statistics(runs[:4]).mean_interval is None
