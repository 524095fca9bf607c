"""Figures: simulations, what was tried, the progress of searches, the comparison of methods.

The only package that imports matplotlib. Functions draw on given axes or a new figure, and need no display.
"""

import logging
from typing import TYPE_CHECKING

from falsifier.views.plotting.analyses import plot_coverage, plot_robustness_map
from falsifier.views.plotting.axes import png, save_figure, svg
from falsifier.views.plotting.runs import plot_comparison, plot_history, plot_rates
from falsifier.views.plotting.simulation import (
    plot,
    plot_evaluation,
    plot_panels,
    plot_requirement,
    plot_trajectory,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure

# Where no home is writable, matplotlib keeps its fonts in a temporary folder, and advises to set a variable.
logging.getLogger("matplotlib").addFilter(lambda record: record.funcName != "_get_config_or_cache_dir")

__all__ = [
    "plot",
    "plot_comparison",
    "plot_coverage",
    "plot_evaluation",
    "plot_history",
    "plot_panels",
    "plot_rates",
    "plot_requirement",
    "plot_robustness_map",
    "plot_trajectory",
    "png",
    "save_figure",
    "svg",
]
