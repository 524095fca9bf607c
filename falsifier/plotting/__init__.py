"""Pictures: what was simulated, what decided the verdict, how searches went and how methods compare.

The only place that imports matplotlib. Functions draw on the axes that they are given, or make a figure;
nothing here needs a display.
"""

from falsifier.plotting.campaign import plot_comparison, plot_history, plot_rates
from falsifier.plotting.evaluation import plot_evaluation, plot_panel, save_figure
from falsifier.plotting.neighbourhood import plot_neighbourhood

__all__ = [
    "plot_comparison",
    "plot_evaluation",
    "plot_history",
    "plot_neighbourhood",
    "plot_panel",
    "plot_rates",
    "save_figure",
]
