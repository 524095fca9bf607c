"""Captions and tables beside the plots."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from falsifier.campaigns.analysis import Run, load
from falsifier.views.plotting.panels import Bound, Panel
from falsifier.views.report.figures import history_figure, rate_figure, simulation_figures

TIMES = np.linspace(0.0, 10.0, 101)
EVIL = "</script><script>alert(1)</script>"


@pytest.fixture(scope="module")
def runs(campaign: Path) -> list[Run]:
    return [run for run in load(campaign) if run.requirement == "HARD" and run.method.engine == "uniform"]


def test_a_history_has_a_row_for_each_seed(runs: list[Run]) -> None:
    text = history_figure(runs, EVIL)
    assert text.count("<tr>") == 1 + len(runs)
    assert EVIL not in text
    for run in runs:
        assert run.counterexample is not None
        assert f"<td>{np.nanmin(run.robustness):.6g}</td><td>{run.counterexample + 1}</td>" in text


def test_a_method_whose_simulations_all_failed_has_a_sentence(runs: list[Run]) -> None:
    failed = [replace(run, robustness=np.full(3, np.nan), counterexample=None) for run in runs]
    text = history_figure(failed, "uniform")
    assert "Every simulation failed" in text and "plots" not in text


def test_rates_have_a_row_for_each_method(runs: list[Run]) -> None:
    text = rate_figure({"one": runs, EVIL: runs[:1]})
    assert EVIL not in text
    after = ", ".join(map(str, sorted(run.simulations for run in runs)))
    assert f"<td>2 of 2</td><td>{after}</td>" in text


def test_a_simulation_has_its_values_at_round_times_and_at_the_critical_time() -> None:
    bound = Bound(EVIL, 2.0, 4.0, np.ones(101))
    text = simulation_figures([Panel(EVIL, TIMES, TIMES**2, (bound,), critical=3.3)], 3.3, 100)
    assert EVIL not in text
    assert text.count("<tr>") == 1 + 11 + 1
    assert '<th scope="row">3.3 (marked)</th><td>10.89</td>' in text
    assert "from 2 s to 4 s" in text
    assert simulation_figures([], None, 100) == ""


def test_a_panel_of_a_system_is_headed_by_its_component() -> None:
    panel = Panel("plant.y [m]", TIMES, TIMES, component="plant")
    text = simulation_figures([panel, replace(panel, title="time", component="")], None, 100)
    assert "<b>plant: plant.y [m]</b>" in text and "<b>time</b>" in text
