from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from falsifier import Trajectory
from falsifier.analyses.coverage import coverage_of
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, Range
from falsifier.core.signals import Signal
from falsifier.counterexamples.robustness_map import robustness_map
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import START, lag_problem
from falsifier.views.plotting import plot_coverage, plot_robustness_map, png, save_figure
from falsifier.views.plotting.axes import wrapped
from tests.analyses.test_coverage import TIMES, described
from tests.pictures import CRITICAL, OUTPUT, colours
from tests.views.plotting.support import xs, ys

NEVER = "#f2b8b0"
U = Range(name="u", low=0.0, high=10.0)
P = Range(name="p", low=0.0, high=1.0)


def test_lines_do_not_end_within_the_name_of_an_option() -> None:
    assert wrapped("try --api-base", 12) == "try\n--api-base"


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


def test_axes_of_ranges_in_decades_are_logarithmic() -> None:
    p, q = (Range(name=name, low=1e-8, high=100.0, scale="log") for name in "pq")
    candidate = Candidate({}, {"p": 1e-3, "q": 1.0})
    figure = plot_coverage(coverage_of(described(parameters=(p, q)), [(candidate, None)]))
    scales = [(ax.get_xscale(), ax.get_yscale()) for ax in figure.axes[:3]]
    assert scales == [("log", "linear"), ("log", "linear"), ("log", "log")]
    assert png(figure, dpi=50)


@pytest.mark.parametrize("high", [1.2, 4.9, 8.0, 20.0, 60.0, 99.0, 300.0])
def test_numbers_beside_an_axis_in_decades_do_not_overlap(high: float) -> None:
    p, q = (Range(name=name, low=2e-3, high=2e-3 * high, scale="log") for name in "pq")
    candidate = Candidate({}, {"p": 2e-3, "q": 2e-3})
    figure = plot_coverage(coverage_of(described(parameters=(p, q)), [(candidate, None)]))
    figure.draw_without_rendering()
    for ax in figure.axes[:3]:
        labels = [*ax.get_xticklabels(), *ax.get_xticklabels(minor=True)]
        boxes = [label.get_window_extent() for label in labels if label.get_text()]
        left, right = ax.get_window_extent().intervalx
        ends = sorted((box.x0, box.x1) for box in boxes if left <= (box.x0 + box.x1) / 2 <= right)
        assert len(ends) > 1 and all(a[1] < b[0] for a, b in pairwise(ends)), ends


def test_red_is_what_was_never_tried() -> None:
    halves = Range(name="u", low=0, high=1, kind="boolean")
    one = Candidate({"u": Signal((0.0,), (1.0,), "constant")})
    both = Candidate({"u": Signal((0.0,), (0.0,), "constant")})
    found = [coverage_of(described(halves), [(c, None) for c in cs]) for cs in ([one], [one, both])]
    pictures = [png(plot_coverage(each), dpi=50) for each in found]
    assert [NEVER in colours(picture) for picture in pictures] == [True, False]


def test_items_with_numbers_far_apart_are_drawn_side_by_side() -> None:
    items = (("init", 1), ("run", 2), ("error", 255))
    modes = Range(name="u", low=1, high=255, kind="enumeration", items=items)
    constant = Candidate({"u": Signal((0.0,), (255.0,), "constant")})
    ax = plot_coverage(coverage_of(described(modes), [(constant, None)])).axes[0]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["init", "run", "error"]
    assert ax.get_ylim() == (-0.5, 2.5)


def test_two_coordinates_are_a_map_whose_boundary_lies_where_the_violation_ends() -> None:
    # x(10) is u, nearly: it violates where u is above 0.5.
    lag = lag_problem("G[10,10] (x <= 0.5)", free=Freedom(5, 0.1), parameters=[START])
    start = evaluate(lag, Candidate({"u": Signal((0.0,), (0.54,), "constant")}, {"x0": 0.0}))
    found = robustness_map(lag, start, budget=45)
    figure = plot_robustness_map(found, "LAG")
    sizes, surface = figure.axes[:2]
    assert figure.get_suptitle() == "LAG: robustness around the counterexample"
    assert (surface.get_xlabel(), surface.get_ylabel()) == ("u [V]", "x0")
    drawn = {line.get_label(): ys(line) for line in sizes.get_lines()}
    assert (drawn["violated"] < 0).all() and (drawn["satisfied"] >= 0).all()
    assert len(drawn["violated"]) + len(drawn["satisfied"]) == len(found.robustness)
    assert drawn["counterexample"].tolist() == [start.robustness]
    (boundary,) = [c for c in surface.collections if type(c).__name__ == "QuadContourSet"]
    across = np.concatenate([path.vertices for path in boundary.get_paths()])
    assert across[:, 0] == pytest.approx(0.5, abs=1e-3)
    ticks = figure.axes[2].get_yticks()
    assert 0.0 in ticks and min(ticks) < 0 < max(ticks), "the scale includes 0, and both sides have numbers"
    mesh = next(c for c in surface.collections if type(c).__name__ == "QuadMesh")
    (red, _, blue, _), (red_, _, blue_, _) = mesh.to_rgba(np.array([-1e-3, 1e-3]) * abs(found.original))
    assert red > blue and blue_ > red_, "violations have a colour of their own, however small"


def test_of_a_failed_simulation_the_picture_of_a_map_says_nothing() -> None:
    lag = lag_problem(points=1)
    found = robustness_map(lag, evaluate(lag, lag.space.decode([1.0])), budget=7)
    failed = replace(found, robustness=np.full_like(found.robustness, np.nan))
    lines = plot_robustness_map(failed).axes[0].get_lines()
    assert {line.get_label() for line in lines}.isdisjoint({"satisfied", "violated"})


def test_a_single_coordinate_is_a_line_through_the_counterexample(tmp_path: Path) -> None:
    lag = lag_problem(points=1)
    start = evaluate(lag, lag.space.decode([1.0]))
    figure = plot_robustness_map(robustness_map(lag, start, budget=45))
    assert figure.get_suptitle() == "robustness around the counterexample"
    line, counterexample, _ = figure.axes[1].get_lines()
    assert figure.axes[1].get_xlabel() == "u [V]"
    # Down to 0.9, 5 % of the range of 2: there it does not violate any more.
    assert xs(line)[[0, -1]] == pytest.approx([0.9, 1.0])
    assert np.sign(ys(line)[[0, -1]]).tolist() == [1.0, -1.0]
    assert (xs(counterexample).tolist(), ys(counterexample).tolist()) == ([1.0], [start.robustness])
    save_figure(figure, tmp_path / "map.png")
    assert {OUTPUT, CRITICAL} <= colours(tmp_path / "map.png")
