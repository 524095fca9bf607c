import numpy as np
import pytest
from matplotlib.figure import Figure

from falsifier import Evaluation
from falsifier.core.candidate import Candidate
from falsifier.views.plotting import (
    plot_requirement,
)
from tests.problems import hard
from tests.views.plotting.support import simulated


def test_a_requirement_is_drawn_on_given_axes_up_to_its_critical_time() -> None:
    evaluation, ax = simulated(), Figure().subplots()
    assert evaluation.verdict is not None
    assert plot_requirement(hard(), evaluation, ax) is ax.get_figure()
    dots = [line for line in ax.get_lines() if line.get_marker() == "o"]
    assert [np.asarray(dot.get_xdata()).tolist() for dot in dots] == [[evaluation.verdict.critical_time]]


def test_a_failed_simulation_has_nothing_to_draw() -> None:
    with pytest.raises(ValueError, match="nothing to draw"):
        plot_requirement(hard(), Evaluation(Candidate(), "failed"))
