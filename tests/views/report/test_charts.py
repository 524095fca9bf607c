"""The drawings of reports, read as SVG."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from falsifier.campaigns.analysis import Run, load
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.views.panels import Bound, Panel
from falsifier.views.report.charts import history_chart, panel_chart, rate_chart

TIMES = np.linspace(0.0, 10.0, 101)
STEP = Candidate({"u": Signal((0.0, 5.0), (0.0, 1.0), "constant")})


def parts(svg: str, kind: str) -> list[ElementTree.Element]:
    """Elements of a class."""
    return [e for e in ElementTree.fromstring(svg).iter() if kind in (e.get("class") or "").split()]


def numbers(path: ElementTree.Element) -> list[float]:
    return [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?", path.get("d") or "")]


@pytest.fixture
def runs(campaign: Path) -> list[Run]:
    return [run for run in load(campaign) if run.requirement == "HARD" and run.method.engine == "uniform"]


def test_a_history_has_a_dot_for_each_simulation_and_a_line_that_only_falls(runs: list[Run]) -> None:
    svg = history_chart(runs, "a < b")
    assert [path.get("d", "").count("h0") for path in parts(svg, "dots")] == [run.simulations for run in runs]
    for path in parts(svg, "best"):
        heights = [float(y) for y in re.findall(r"(?:M[\d.]+ |V)([\d.]+)", path.get("d") or "")]
        assert heights == sorted(heights), "down is larger in a drawing"
    assert len(parts(svg, "critical")) == 2
    assert ElementTree.fromstring(svg).get("aria-label") == "Robustness over simulations, a < b"


def test_runs_without_any_robustness_are_left_out(runs: list[Run]) -> None:
    failed = [replace(run, robustness=np.full(3, np.nan), counterexample=None) for run in runs]
    assert "<svg" not in history_chart(failed, "x")
    assert len(parts(history_chart([runs[0], failed[1]], "x"), "dots")) == 1


def test_a_long_history_is_thinned(runs: list[Run]) -> None:
    long = replace(runs[0], robustness=np.random.default_rng(0).random(5000), counterexample=None)
    (dots,) = parts(history_chart([long], "x"), "dots")
    assert dots.get("d", "").count("h0") == 300


def test_rates_have_a_curve_for_each_method_in_a_colour_of_its_own(runs: list[Run]) -> None:
    svg = rate_chart({"one": runs, "other": runs[:1]})
    assert [e.get("class") for e in parts(svg, "series")] == ["series s0", "series s1"]
    assert parts(rate_chart({}), "series") == []


def test_a_quantity_is_drawn_with_bounds_windows_and_what_decided() -> None:
    bound = Bound("x <= 1", 2.0, 4.0, np.ones(101))
    panel = Panel("x [m]", TIMES, np.sin(TIMES), (bound,), critical=3.0)
    svg = panel_chart(panel, 3.0)
    (window,), (line,), (time,), (dot,) = (
        parts(svg, kind) for kind in ("window", "bound", "critical-time", "critical")
    )
    left, right = numbers(line)[0], numbers(line)[-2]
    assert float(window.get("x") or 0) == pytest.approx(left, abs=0.1)
    assert float(window.get("width") or 0) == pytest.approx(right - left, abs=0.2)
    middle = float(time.get("x1") or 0)
    assert middle == pytest.approx((left + right) / 2, abs=0.1)
    assert float(dot.get("cx") or 0) == middle
    assert not parts(svg, "input") and len(parts(svg, "output")) == 1


def test_an_input_is_drawn_with_its_control_points_and_limits_as_steps() -> None:
    values = STEP.signals["u"].sample(TIMES)
    panel = Panel("u", TIMES, values, points=((0.0, 0.0), (5.0, 1.0)), limits=(-1.0, 1.0), steps=True)
    svg = panel_chart(panel, None)
    assert len(parts(svg, "point")) == len(parts(svg, "limit")) == 2
    assert set(re.sub(r"[\d. -]", "", parts(svg, "input")[0].get("d") or "")) == {"M", "H", "V"}
    assert not parts(svg, "critical-time")


def test_a_long_trajectory_keeps_its_extremes() -> None:
    times = np.linspace(0.0, 10.0, 100_001)
    values = np.zeros_like(times)
    values[34_567] = 5.0
    (path,) = parts(panel_chart(Panel("x", times, values), None), "output")
    heights = numbers(path)[1::2]
    assert len(heights) < 1000
    assert len(set(heights)) == 2, "the peak of one sample is seen"


@pytest.mark.parametrize("level", [0.0, -3.0, 1e6])
def test_a_constant_has_room_around_it(level: float) -> None:
    (path,) = parts(panel_chart(Panel("x", TIMES, np.full(101, level)), None), "output")
    assert 22 < numbers(path)[1] < 140
