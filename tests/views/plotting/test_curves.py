from pathlib import Path

import numpy as np

from falsifier.campaigns.analysis import load
from falsifier.views.plotting.runs import falsification_curve, improvements, thinned


def test_curves(campaign: Path) -> None:
    runs = [run for run in load(campaign) if run.method.engine == "uniform"]
    counts, shares = falsification_curve(runs)
    found = sorted(run.simulations for run in runs if run.falsified)
    assert counts.tolist() == [0, *found, 20]
    assert shares.tolist() == [0, 0.25, 0.5, 0.5]
    values = np.array([3.0, np.nan, 4.0, 1.0, 1.0, 0.5])
    assert [c.tolist() for c in improvements(values)] == [[1, 4, 6], [3, 1, 0.5]]
    assert [c.tolist() for c in improvements(np.array([np.nan, 2.0]))] == [[2], [2]]
    assert [c.tolist() for c in thinned(values, 2)] == [[4, 6], [1, 0.5]]
    assert len(thinned(values, 10)[0]) == 5
