import numpy as np

from falsifier import Candidate, Signal, Trajectory
from falsifier.analyses.coverage import coverage_of
from falsifier.record.manifest import InputRecord
from falsifier.views.plotting import plot_coverage, png
from tests.analyses.test_coverage import TIMES, described
from tests.pictures import colours
from tests.views.plotting.support import ys

NEVER = "#f2b8b0"
U = InputRecord(name="u", low=0.0, high=10.0)
P = InputRecord(name="p", low=0.0, high=1.0)


def test_there_is_a_panel_of_each_input_parameter_pair_and_output() -> None:
    candidates = [Candidate({"u": Signal((0.0,), (v,))}, {"p": 0.5}) for v in (1.0, 2.0)]
    trajectories = [Trajectory(TIMES, {"x": k * TIMES}) for k in (1.0, 2.0)]
    figure = plot_coverage(
        coverage_of(described(U, parameters=(P,)), zip(candidates, trajectories, strict=True)), "A"
    )
    assert [ax.get_ylabel() for ax in figure.axes] == ["u", "simulations", "p", "x"]
    assert figure.axes[2].get_title() == "2 of 100 combinations"
    lows, highs = map(ys, figure.axes[3].lines)
    assert np.array_equal(lows, TIMES) and np.array_equal(highs, 2 * TIMES)
    assert figure.get_suptitle() == "A: what 2 simulations tried (red: never)"


def test_red_is_what_was_never_tried() -> None:
    halves = InputRecord(name="u", low=0, high=1, kind="boolean")
    one = Candidate({"u": Signal((0.0,), (1.0,), "constant")})
    both = Candidate({"u": Signal((0.0,), (0.0,), "constant")})
    found = [coverage_of(described(halves), [(c, None) for c in cs]) for cs in ([one], [one, both])]
    pictures = [png(plot_coverage(each), dpi=50) for each in found]
    assert [NEVER in colours(picture) for picture in pictures] == [True, False]
