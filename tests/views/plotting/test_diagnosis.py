from matplotlib.figure import Figure

from falsifier.views.plotting import (
    plot_diagnosis,
)
from tests.problems import hard
from tests.views.plotting.support import simulated


def test_a_diagnosis_names_the_window_of_each_operator() -> None:
    ax = Figure().subplots()
    plot_diagnosis(hard(), simulated(), ax)
    assert [text.get_text().split()[0] for text in ax.texts] == ["G"]
