from matplotlib.figure import Figure

from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import lag_problem
from falsifier.views.plotting import plot_diagnosis
from tests.views.plotting.support import ys


def test_each_operator_has_its_window_and_inner_ones_are_where_they_decided() -> None:
    # x falls from the sixth second on: its last three seconds are the worst to find a high value in.
    problem = lag_problem("G[0,7] F[0,3] (x >= 0.5)", points=4)
    evaluation = evaluate(problem, problem.space.decode([1.0, 1.0, 1.0, -1.0]))
    ax = Figure().subplots()
    plot_diagnosis(problem, evaluation, ax)
    assert [text.get_text() for text in ax.texts] == ["x >= 0.5", "G over [0, 7] s", "F over [0, 3] s"]
    spans = [c.get_paths()[0].get_extents() for c in ax.collections if c.get_alpha() == 0.8]
    assert [(round(s.x0, 6), round(s.x1, 6)) for s in spans] == [(0.0, 7.0), (0.0, 3.0)]
    low, _ = ax.get_ylim()
    assert low < ys(ax.get_lines()[0]).min(), "there is room for the windows below the curve"


def test_without_axes_it_makes_a_figure() -> None:
    problem = lag_problem()
    figure = plot_diagnosis(problem, evaluate(problem, problem.space.decode([1.0] * 4)))
    assert [text.get_text() for text in figure.axes[0].texts] == ["x <= 0.9", "G over [0, 10] s"]
