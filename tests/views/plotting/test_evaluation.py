import numpy as np
import pytest
from matplotlib.figure import Figure

from falsifier import Evaluation, evaluate, falsify
from falsifier.core.candidate import Candidate
from falsifier.views.plotting import (
    plot_diagnosis,
    plot_predictions,
    plot_requirement,
    plot_signal,
    plot_trajectory,
)
from tests.problems import hard


def simulated() -> Evaluation:
    return evaluate(hard(), falsify(hard(), "corners", budget=1).evaluations[0].candidate)


def test_a_requirement_is_drawn_on_given_axes_up_to_its_critical_time() -> None:
    evaluation, ax = simulated(), Figure().subplots()
    assert evaluation.verdict is not None
    assert plot_requirement(hard(), evaluation, ax) is ax.get_figure()
    dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
    assert [np.asarray(dot.get_xdata()).tolist() for dot in dots] == [[evaluation.verdict.critical_time]]


def test_a_failed_simulation_has_nothing_to_draw() -> None:
    with pytest.raises(ValueError, match="nothing to plot"):
        plot_requirement(hard(), Evaluation(Candidate(), "failed"))


def test_a_diagnosis_names_the_window_of_each_operator() -> None:
    ax = Figure().subplots()
    plot_diagnosis(hard(), simulated(), ax)
    assert [text.get_text().split()[0] for text in ax.texts] == ["G"]


def test_a_trajectory_has_a_panel_for_each_signal_and_a_signal_its_unit() -> None:
    trajectory = simulated().trajectory
    assert trajectory is not None
    assert [ax.get_ylabel() for ax in plot_trajectory(trajectory).axes] == ["x [m]", "u [V]"]
    ax = Figure().subplots()
    plot_signal(trajectory, "x", ax, label="one")
    assert ax.get_lines()[0].get_label() == "one"


def test_predictions_lie_on_the_diagonal_where_they_are_right() -> None:
    ax = Figure().subplots()
    plot_predictions([1.0, -2.0], [1.0, -2.0], ax)
    points = next(line for line in ax.get_lines() if line.get_marker() == ".")
    assert np.array_equal(points.get_xdata(), points.get_ydata())
