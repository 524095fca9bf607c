"""What the plots of reports show, as numbers."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from falsifier.campaigns.analysis import Run, load
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.views.plotting.panels import Bound, Panel
from falsifier.views.report.plots import (
    Plots,
    columns,
    history_plot,
    rate_plot,
    scripts,
    simulation_plots,
)

TIMES = np.linspace(0.0, 10.0, 101)
STEP = Candidate({"u": Signal((0.0, 5.0), (0.0, 1.0), "constant")})


def shown(plots: Plots | None) -> Any:
    """What the script reads."""
    assert plots is not None
    return json.loads(plots.json())


def curves(plot: Any, style: str) -> list[Any]:
    return [c for c in [*plot["lines"], *plot.get("dots", [])] if c["style"] == style]


@pytest.fixture
def runs(campaign: Path) -> list[Run]:
    return [run for run in load(campaign) if run.requirement == "HARD" and run.method.engine == "uniform"]


def test_a_history_has_a_dot_for_each_simulation_and_a_line_that_only_falls(runs: list[Run]) -> None:
    (plot,) = shown(history_plot(runs))["plots"]
    assert [len(dots["x"]) for dots in curves(plot, "dots")] == [run.simulations for run in runs]
    assert [dots["seed"] for dots in curves(plot, "dots")] == [run.seed for run in runs]
    for line, run in zip(curves(plot, "best"), runs, strict=True):
        assert line["y"] == sorted(line["y"], reverse=True)
        assert (line["x"][0], line["x"][-1]) == (1, len(run.robustness))
        assert line["y"][-1] == pytest.approx(np.nanmin(run.robustness))
    assert len(curves(plot, "critical")) == 2


def test_runs_without_any_robustness_are_left_out(runs: list[Run]) -> None:
    failed = [replace(run, robustness=np.full(3, np.nan), counterexample=None) for run in runs]
    assert history_plot(failed) is None
    (plot,) = shown(history_plot([runs[0], failed[1]]))["plots"]
    assert len(curves(plot, "dots")) == 1


def test_a_long_history_is_thinned(runs: list[Run]) -> None:
    long = replace(runs[0], robustness=np.random.default_rng(0).random(5000), counterexample=None)
    (plot,) = shown(history_plot([long]))["plots"]
    assert len(curves(plot, "dots")[0]["x"]) == 1000


def test_rates_have_a_curve_for_each_method_in_a_colour_of_its_own(runs: list[Run]) -> None:
    (plot,) = shown(rate_plot({"one": runs, "other": runs[:1]}))["plots"]
    assert [line["style"] for line in plot["lines"]] == ["s0", "s1"]
    assert shown(rate_plot({}))["plots"][0]["lines"] == []


def test_a_quantity_is_drawn_with_bounds_windows_and_what_decided() -> None:
    bound = Bound("x <= 1", 2.0, 4.0, np.ones(101))
    group = shown(simulation_plots([Panel("x [m]", TIMES, np.sin(TIMES), (bound,), critical=3.0)], 3.0, 1000))
    (plot,) = group["plots"]
    assert (group["start"], group["end"], group["mark"]) == (0.0, 10.0, 3.0)
    assert plot["windows"] == [[2.0, 4.0]]
    (line,), (dot,) = curves(plot, "bound"), curves(plot, "critical")
    assert (line["x"][0], line["x"][-1], set(line["y"])) == (2.0, 4.0, {1.0})
    assert (dot["x"], dot["y"]) == ([3.0], [pytest.approx(np.sin(3.0))])
    assert not curves(plot, "input") and len(curves(plot, "output")[0]["x"]) == 101


def test_an_input_is_drawn_with_its_control_points_and_limits_as_steps() -> None:
    values = STEP.signals["u"].sample(TIMES)
    panel = Panel("u", TIMES, values, points=((0.0, 0.0), (5.0, 1.0)), limits=(-1.0, 1.0), steps=True)
    group = shown(simulation_plots([panel], None, 1000))
    (plot,) = group["plots"]
    assert group["mark"] is None
    assert [level["y"] for level in plot["levels"]] == [-1.0, 1.0]
    assert curves(plot, "point")[0] == {"x": [0.0, 5.0], "y": [0.0, 1.0], "style": "point"}
    assert curves(plot, "input")[0]["steps"]


def test_a_long_trajectory_keeps_its_extremes() -> None:
    times = np.linspace(0.0, 10.0, 100_001)
    values = np.zeros_like(times)
    values[34_567] = 5.0
    (plot,) = shown(simulation_plots([Panel("x", times, values)], None, columns(1)))["plots"]
    (line,) = curves(plot, "output")
    assert len(line["x"]) <= 2002
    assert max(line["y"]) == 5.0, "the peak of one sample is seen"


def test_a_page_with_many_curves_draws_each_more_coarsely() -> None:
    assert columns(1) > columns(100) >= columns(10_000) > 0


@pytest.mark.parametrize("level", [0.0, -3.0, 1e6, 1e300])
def test_a_constant_has_room_around_it(level: float) -> None:
    panel = Panel("x", TIMES, np.full(101, level))
    low, high = shown(simulation_plots([panel], None, 1000))["plots"][0]["range"]
    assert low < level < high


def test_no_text_from_outside_enters_the_numbers() -> None:
    evil = "</script><script>alert(1)</script>"
    bound = Bound(evil, 2.0, 4.0, np.ones(101))
    plots = simulation_plots([Panel(evil, TIMES, np.sin(TIMES), (bound,))], None, 1000)
    assert plots is not None and "<" not in plots.json() and "alert" not in plots.json()


def test_the_scripts_fit_into_a_page_and_come_without_importing_bokeh() -> None:
    program = (
        "import sys; from falsifier.views.report.plots import scripts;"
        "print(len(scripts()), [name for name in sys.modules if name.startswith('bokeh')])"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "3 []"
    for text in scripts():
        assert "</script" not in text and "<!--" not in text and "\r" not in text
