from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from falsifier.campaigns.analysis import load
from falsifier.record.journal import read_journal, recorded_evaluations
from falsifier.views.plotting import plot_comparison, plot_history, plot_rates
from tests.views.plotting.support import xs, ys


def test_a_history_shows_every_simulation_and_the_counterexample(campaign: Path) -> None:
    found = next(run for run in load(campaign) if run.falsified)
    figure = plot_history([found])
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    recorded = list(recorded_evaluations(read_journal(found.directory), "HARD").values())
    assert ys(lines["robustness"]).tolist() == [e.robustness for e in recorded]
    best = ys(lines["smallest so far"])
    assert (np.diff(best) <= 0).all() and best[-1] == min(e.robustness or 0.0 for e in recorded)
    assert xs(lines["counterexample"]).tolist() == [len(recorded)]
    assert ys(lines["counterexample"]).tolist() == [recorded[-1].robustness]
    assert figure.axes[0].get_title() == "HARD: uniform"
    assert plot_history(replace(found, _robustness=[np.nan], counterexample=None)).axes, "nothing was judged"


def test_rates_end_at_the_share_of_falsified_runs(campaign: Path) -> None:
    runs = load(campaign)
    axes = plot_rates([*runs, replace(runs[0], status="interrupted")]).axes[0]
    assert [line.get_label() for line in axes.get_lines()] == ["uniform (4 runs)", "corners (4 runs)"]
    assert [ys(line)[-1] for line in axes.get_lines()] == [0.5, 0.5]


def test_a_comparison_has_a_bar_for_each_requirement_and_method(campaign: Path) -> None:
    ax = Figure().subplots()
    figure = plot_comparison(load(campaign), ax)
    assert figure.axes[0] is ax
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle)]
    assert [bar.get_height() for bar in bars] == [1.5, 0.0, 1.5, 0.0]
    assert [text.get_text() for text in ax.texts] == ["2/2", "0/2", "2/2", "0/2"]
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["HARD", "NEVER"]


@pytest.mark.filterwarnings("error")
def test_of_no_runs_empty_axes_are_drawn() -> None:
    for plot in (plot_comparison, plot_rates, plot_history):
        assert plot([]).axes[0].get_legend() is None
