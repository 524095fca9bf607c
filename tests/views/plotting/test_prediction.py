from matplotlib.figure import Figure

from falsifier.views.plotting import plot_predictions
from tests.views.plotting.support import xs, ys


def test_what_was_predicted_goes_across_and_what_was_simulated_up() -> None:
    ax = Figure().subplots()
    assert plot_predictions([1.0, 3.0], [-2.0, 0.5], ax) is ax.get_figure()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("predicted robustness", "simulated robustness")
    diagonal, points, *zeros = ax.get_lines()
    # The diagonal reaches over both ranges, so that every point is seen above or below it.
    assert xs(diagonal).tolist() == ys(diagonal).tolist() == [-2.0, 3.0]
    assert (xs(points).tolist(), ys(points).tolist()) == ([1.0, 3.0], [-2.0, 0.5])
    assert len(zeros) == 2


def test_without_axes_it_makes_a_figure() -> None:
    assert plot_predictions([0.0], [0.0]).axes[0].get_xlabel() == "predicted robustness"
