import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from falsifier import Evaluation, falsify
from falsifier.core.candidate import Candidate
from falsifier.core.function_model import FunctionModel
from falsifier.core.trajectory import Trajectory
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.search.result import Result
from falsifier.testing import START, lag_problem
from falsifier.views.plotting import plot, plot_evaluation, plot_requirement, plot_trajectory, png
from tests.fmu.small_systems import LOOP, system
from tests.pictures import CRITICAL
from tests.problems import conditional, hard, unusable
from tests.views.plotting.support import simulated, xs, ys


def drawn(problem: Problem, level: float = 1.0) -> Figure:
    """The picture of a simulation with inputs that stay at this level."""
    return plot_evaluation(problem, evaluate(problem, problem.space.decode([level] * 4)))


def test_a_requirement_is_drawn_on_given_axes() -> None:
    evaluation, ax = simulated(), Figure().subplots()
    assert evaluation.verdict is not None
    assert plot_requirement(hard(), evaluation, ax) is ax.get_figure()
    dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
    assert [xs(dot).tolist() for dot in dots] == [[evaluation.verdict.critical_time]]
    assert evaluation.verdict.breach is not None
    first, decided = ax.get_title().splitlines()
    assert first == evaluation.verdict.breach.text
    assert f"decided by x <= 0.6 at {evaluation.verdict.critical_time:.5g} s" in decided


def test_an_evaluation_has_a_panel_for_what_is_compared_and_for_each_input() -> None:
    problem = lag_problem(parameters=[START])
    evaluation = evaluate(problem, problem.space.decode([1.0, 1.0, 0.5, 1.0, 0.25]))
    figure = plot_evaluation(problem, evaluation)
    output, input_ = figure.axes
    assert (output.get_ylabel(), input_.get_ylabel()) == ("x [m]", "u [V]")
    bound = output.get_lines()[1]
    assert set(ys(bound).tolist()) == {0.9}
    points = [line for line in input_.get_lines() if line.get_marker() == "o"]
    assert ys(points[0]).tolist() == [1.0, 1.0, 0.5, 1.0]
    low, high = input_.get_ylim()
    assert low < -1.0 and high > 1.0, "the whole range of the input is seen"
    first, decided, formula, parameters = figure.get_suptitle().splitlines()
    assert first.startswith("LAG: x <= 0.9 was violated from ")
    assert decided.startswith("robustness -")
    assert (formula, parameters) == ("G[0,10] (x <= 0.9)", "x0 = 0.25")
    assert [text.get_text() for text in output.texts] == ["x <= 0.9"]
    keys = ["limit", "violated (worst interval)", "farthest off", "control point of an input"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == keys


def test_what_broke_is_marked_and_what_decided_is_only_a_ring() -> None:
    problem = conditional()
    evaluation = evaluate(problem, problem.space.decode([0.95] * 4))
    assert evaluation.verdict is not None and evaluation.verdict.predicate == "u >= 0.9"
    figure = plot_evaluation(problem, evaluation)
    condition, consequence, _ = figure.axes
    (ring,), (dot,) = ([x for x in ax.get_lines() if x.get_marker() == "o"] for ax in figure.axes[:2])
    assert (xs(dot).tolist(), dot.get_markerfacecolor()) == ([10.0], CRITICAL)
    assert (xs(ring).tolist(), ring.get_markerfacecolor()) == ([evaluation.verdict.critical_time], "none")
    assert len(consequence.patches) == 2, "the window of the requirement, and when it was violated"
    assert len(condition.patches) == 1
    told = figure.get_suptitle().splitlines()
    assert told[0].startswith("COND: x <= 0.5 was violated from 0.8 to 10 s: x = 0.9499")
    assert told[1].startswith("while u >= 0.9 held")
    ax = plot_requirement(problem, evaluation).axes[0]
    assert ax.get_ylabel() == "x [m]"


def test_a_nearest_miss_is_not_drawn_as_a_violation() -> None:
    figure = drawn(lag_problem(), 0.0)
    assert figure.get_suptitle().startswith("LAG: not violated, robustness +0.9")
    dots = [line for line in figure.axes[0].get_lines() if line.get_marker() == "o"]
    assert [dot.get_color() for dot in dots] == ["#b35900"]
    keys = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "nearest to a violation" in keys and not any("violated" in key for key in keys)


@pytest.mark.parametrize("draw", [plot_evaluation, plot_requirement])
def test_a_margin_that_the_scale_hides_is_enlarged(draw: Callable[[Problem, Evaluation], Figure]) -> None:
    hidden = lag_problem("G[0,10] (x <= 0.99998)")
    evaluation = evaluate(hidden, hidden.space.decode([1.0] * 4))
    assert evaluation.verdict is not None
    (inside,) = draw(hidden, evaluation).axes[0].child_axes
    low, high = inside.get_ylim()
    assert high - low < 0.2
    assert np.mean(inside.get_xlim()) == pytest.approx(evaluation.verdict.moment)
    assert len(inside.get_lines()) == 3, "the curve, its bound, and the dot at the critical time"
    assert low < ys(inside.get_lines()[-1])[0] < high
    seen = lag_problem("G[0,10] (x <= 0.5)")
    assert not draw(seen, evaluate(seen, seen.space.decode([1.0] * 4))).axes[0].child_axes


def test_signals_that_are_not_real_are_drawn_in_steps_with_their_names() -> None:
    problem = lag_problem()
    assert problem.info.variables
    variables = tuple(
        replace(v, kind="enumeration", literals={"Off": 0, "On": 1}) if v.name == "x" else v
        for v in problem.info.variables
    )
    model = FunctionModel(
        lambda times, *_: {"x": np.ones_like(times)}, replace(problem.info, variables=variables)
    )
    figure = drawn(replace(problem, model=model))
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["Off", "On"]
    assert figure.axes[0].get_lines()[0].get_drawstyle() == "steps-post"


def test_plot_takes_results_counterexamples_and_trajectories() -> None:
    result = falsify(hard(), "corners", budget=10)
    assert result.counterexample is not None
    titles = [plot(shown).get_suptitle() for shown in (result, result.counterexample)]
    assert titles[0] == titles[1]
    assert titles[0].startswith("HARD: x <= 0.6 was violated from ")
    assert f"robustness {result.counterexample.evaluation.robustness:+.5g}" in titles[0]
    trajectory = result.counterexample.evaluation.trajectory
    assert trajectory is not None
    assert len(plot(trajectory).axes) == 2


def test_what_failed_has_nothing_to_draw() -> None:
    failed = Evaluation(Candidate(), "failed")
    for draw in (plot_requirement, plot_evaluation):
        with pytest.raises(ValueError, match="nothing to plot"):
            draw(hard(), failed)
    result: Result = falsify(unusable(), "corners", budget=10)
    assert result.status == "failed"
    with pytest.raises(ValueError, match="no simulation was judged"):
        plot(result)


def test_the_panels_of_a_system_are_headed_by_their_components() -> None:
    model = system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP)
    formula, inputs = "G (pi.y <= 1 and plant.y <= 2)", {"pi.r": (0.0, 2.0)}
    problem = Problem.from_fmu(model, formula, inputs=inputs, stop_time=1.0, output_interval=0.1)
    evaluation = evaluate(problem, problem.space.decode(problem.space.bounds.T[1]))
    heads = [(ax.get_title("left"), ax.get_ylabel()) for ax in plot_evaluation(problem, evaluation).axes]
    named = [head for head in heads if head[1]]
    assert [name for name, _ in named] == ["plant", "pi", ""]
    assert named[0][1].startswith("plant.y") and named[2][1].startswith("pi.r")


@pytest.mark.filterwarnings("error")
def test_a_name_in_characters_that_the_font_lacks_is_no_warning() -> None:
    times = np.linspace(0.0, 1.0, 3)
    assert png(plot_trajectory(Trajectory(times, {"\N{CJK UNIFIED IDEOGRAPH-6E29}": times})), dpi=50)


def test_a_trajectory_has_a_panel_for_each_signal_with_its_unit() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    figure = plot_trajectory(trajectory)
    assert [ax.get_ylabel() for ax in figure.axes] == ["x [m]", "u [V]"]
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "time [s]"]
    (ax,) = plot_trajectory(trajectory, ["u"]).axes
    assert (ax.get_ylabel(), ax.get_xlabel()) == ("u [V]", "time [s]")


def test_names_that_are_longer_than_a_panel_are_on_several_lines_with_both_ends() -> None:
    times, long = np.linspace(0.0, 1.0, 3), "speed_$of$_the_vehicle_ahead_" * 3
    short, wrapped = (
        ax.get_ylabel() for ax in plot_trajectory(Trajectory(times, {"x": times, f"{long}12": times})).axes
    )
    lines = wrapped.splitlines()
    assert short == "x" and len(lines) == 4 and max(map(len, lines)) < 20
    assert lines[0].startswith("speed_") and lines[-1].endswith("_12") and "..." in wrapped
    assert wrapped.count("$") == wrapped.count(r"\$"), "no mathematical notation"


def test_a_window_of_one_sample_is_seen() -> None:
    output = drawn(lag_problem("F[10,10] (x >= 0.5)"), -1.0).axes[0]
    bound = output.get_lines()[1]
    assert (xs(bound).tolist(), bound.get_marker()) == ([10.0], "_")
    assert [patch.get_linewidth() > 0 for patch in output.patches] == [True, True]
    (name,) = output.texts
    assert name.get_horizontalalignment() == "right", "beyond the panel there is no room"


def test_limits_that_lie_close_to_each_other_are_named_together() -> None:
    output = drawn(lag_problem("G (-0.001 <= x <= 0.001 and x <= 0.8)")).axes[0]
    assert [text.get_text() for text in output.texts] == ["-0.001 <= x, x <= 0.001", "x <= 0.8"]


def test_of_several_limits_the_one_with_the_small_margin_is_enlarged() -> None:
    (inside,) = drawn(lag_problem("G (x <= 0.99998 and x >= -1000)")).axes[0].child_axes
    assert np.ptp(inside.get_ylim()) < 0.2
    assert not drawn(lag_problem("G (x >= 0)"), 0.0).axes[0].child_axes


def test_what_is_enlarged_shows_the_margin_and_times_that_can_be_read() -> None:
    slow = lag_problem("G (x <= 399.99)", response=lambda t, *_: {"x": 400.0 * (1.0 - np.exp(-t / 2e-6))})
    experiment = replace(slow.experiment, stop_time=2e-3, output_interval=1e-7)
    figure = drawn(replace(slow, space=replace(slow.space, stop_time=2e-3), experiment=experiment))
    (inside,) = figure.axes[0].child_axes
    low, high = inside.get_ylim()
    assert high - low < 1.0, "400 V before the marked time hide no margin of 0.01"
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in inside.get_xticklabels() if label.get_text()]
    assert len(boxes) > 1
    assert all(a.x1 < b.x0 for a, b in pairwise(sorted(boxes, key=lambda box: float(box.x0))))


def test_nothing_is_said_of_a_home_that_cannot_be_written() -> None:
    code = "import falsifier.views.plotting, matplotlib.figure"
    hidden = {"MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"}
    own = {name: value for name, value in os.environ.items() if name not in hidden} | {"HOME": os.devnull}
    done = subprocess.run([sys.executable, "-c", code], env=own, capture_output=True, text=True, check=True)
    assert done.stderr == ""
