from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, ParameterRange, ValueKind
from falsifier.core.signals import Signal
from falsifier.counterexamples.robustness_map import RobustnessMap, robustness_map
from falsifier.counterexamples.shrink import sampled_stretches
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.stl.margins import on_limit
from falsifier.testing import lag_problem
from falsifier.views.plotting import plot_robustness_map, png
from tests.problems import decades

# x(10) of x' = u - x, x(0) = x0, by Euler with 0.1 s: u + (x0 - u) 0.9**100. The range of u is 2 wide.
X0 = ParameterRange("x0", -1.0, 1.0, nominal=0.0)


def at(problem: Problem, u: float, x0: float) -> Evaluation:
    return evaluate(problem, Candidate({"u": Signal((0.0,), (u,), "constant")}, {"x0": x0}))


def problem() -> Problem:
    return lag_problem("G[10,10] (x <= 0.5)", free=Freedom(5, 0.1), parameters=(X0,))


def test_the_violation_persists_as_far_as_it_does() -> None:
    found = robustness_map(problem(), at(problem(), 0.54, 0.0), radius=0.1, budget=200)
    assert [c.label for c in found.coordinates] == ["u [V]", "x0"]
    assert found.axes[0] == 0
    shares = dict(found.persistence)
    # u may fall by 0.04, 2 % of its range: all changes up to 1.25 % violate, half of those of 10 % would not.
    assert shares[0.0125] == 1.0
    assert 0.5 < shares[0.1] < 0.95
    np.testing.assert_array_equal(found.robustness < 0, found.values[:, 0] + 1e-9 > 0.5)
    assert found.sizes.max() <= 0.1 + 1e-12
    assert found.surface.shape == (11, 11)
    assert "of u and x0 at once, 100 % of those up to 1.25 % of the range still violate, " in found.text
    # At 10 s u has full effect, x0 almost none.
    u, x0 = found.influences
    assert u < -0.99 and abs(x0) < 0.3
    assert f"robustness correlates most with u [V] ({u:+.2f}) and x0 ({x0:+.2f}) (rank correl" in found.text
    many = replace(found, robustness=np.r_[np.nan, -np.ones(999)], sizes=np.full(1000, 0.1)).text
    assert "99 % of those up to 10 %" in many and "1 simulation failed and counted as no violation." in many


def test_changes_of_a_range_in_decades_are_shares_of_its_decades() -> None:
    found = robustness_map(
        decades(), evaluate(decades(), Candidate({}, {"bias": 2e-5})), radius=0.1, budget=60
    )
    moved = np.log10(found.values[:, 0] / 2e-5)
    np.testing.assert_allclose(np.abs(moved) / 7.0, found.sizes, atol=1e-12)
    assert 0.6 < np.abs(moved).max() <= 0.7 + 1e-9 and moved.min() < -0.4
    assert found.grid[0] == pytest.approx(np.geomspace(2e-5 * 10**-0.7, 2e-5 * 10**0.7, len(found.grid[0])))
    assert (found.surface[0] < 0).tolist() == [1e-5 < value < 10**-4.52 for value in found.grid[0]]
    assert plot_robustness_map(found).axes[1].get_xscale() == "log"


def test_each_axis_of_a_map_has_the_scale_of_its_range() -> None:
    bias = ParameterRange("bias", 1e-7, 1.0, scale="log")
    mixed = lag_problem("G[0,10] (x <= 9)", inputs=0, parameters=(X0, bias))
    found = robustness_map(mixed, evaluate(mixed, mixed.space.decode([0.3, 1e-5])), radius=0.1, budget=60)
    x0, moved = found.values[:, 0] - 0.3, np.log10(found.values[:, 1] / 1e-5)
    np.testing.assert_allclose(found.sizes, np.maximum(np.abs(x0) / 2, np.abs(moved) / 7), atol=1e-12)
    drawn = plot_robustness_map(found).axes[1]
    names = [found.coordinates[i].name for i in found.axes]
    assert dict(zip(names, (drawn.get_xscale(), drawn.get_yscale()), strict=True)) == {
        "x0": "linear",
        "bias": "log",
    }


def test_a_margin_of_nothing_is_shown_as_everywhere_else() -> None:
    found = robustness_map(problem(), at(problem(), 0.54, 0.0), budget=20)
    on = replace(found, original=on_limit("<="), robustness=np.full_like(found.robustness, on_limit("<=")))
    assert "the smallest robustness is +0, without a change it is +0." in on.text


def test_what_moves_nothing_has_no_influence() -> None:
    flat = lag_problem("G[0,10] (x - x >= 1)", parameters=(X0,))
    found = robustness_map(flat, evaluate(flat, flat.space.decode([1.0] * 4 + [0.0])), budget=8)
    assert set(found.influences) == {0.0}
    assert "None of these changes moved the robustness." in found.text
    moved = replace(found, robustness=found.robustness + 1.0)
    assert "correlates with none of these values" in moved.text
    hardly = replace(moved, influences=(-0.5, -0.001)).text
    assert "correlates most with u [V] (-0.50) (rank correlation)" in hardly, "-0.00 is none"


def test_changes_stay_within_the_ranges_and_are_repeatable() -> None:
    first, second = (robustness_map(problem(), at(problem(), 1.0, -1.0), budget=60) for _ in range(2))
    assert first.values[:, 0].max() <= 1.0
    assert first.values[:, 1].min() >= -1.0
    np.testing.assert_array_equal(first.robustness, second.robustness)


def test_each_stretch_moves_alone() -> None:
    free = lag_problem(free=Freedom(5, 0.1))
    signal = Signal((0.0, 2.0, 4.0, 6.0), (1.0, 0.0, 0.0, 1.0), "constant")
    found = robustness_map(free, evaluate(free, Candidate({"u": signal})), budget=30)
    assert [(c.time, c.value) for c in found.coordinates] == [(0.0, 1.0), (2.0, 0.0), (6.0, 1.0)]
    assert found.axes[0] == 2  # what comes last decides x(10)
    signal = Signal((0.0, 0.5, 1.0, 9.5), (0.0, 0.5, 1.0, 0.5), "constant", hold=3.0)
    assert sampled_stretches(signal, 10.0) == [(0, 1), (2, 3)], "of what is held, what is sampled"


@pytest.mark.filterwarnings("error")
def test_what_was_simulated_before_the_user_stopped_it_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(after: int) -> RobustnessMap:
        def limited(problem: Problem, candidate: Candidate) -> Evaluation:
            nonlocal after
            if not after:
                raise KeyboardInterrupt
            after -= 1
            return evaluate(problem, candidate)

        monkeypatch.setattr("falsifier.counterexamples.robustness_map.evaluate", limited)
        return robustness_map(problem(), at(problem(), 0.54, 0.0), radius=0.1, budget=200)

    with pytest.raises(KeyboardInterrupt):
        stopped(0)
    assert set(stopped(1).influences) == {0.0}
    early, late, whole = stopped(20), stopped(150), stopped(200)
    assert (early.interrupted, late.interrupted, whole.interrupted) == (True, True, False)
    assert len(early.robustness) == len(early.values) == 20 and np.isnan(early.surface).all()
    assert [size for size, _ in early.persistence] == [0.0125], "larger changes come later"
    assert early.text.endswith("Stopped by the user.")
    assert len(late.persistence) == 4 and late.surface.shape == whole.surface.shape
    known = np.isfinite(late.surface)
    assert 0 < known.sum() < known.size
    np.testing.assert_array_equal(late.surface[known], whole.surface[known])
    assert png(plot_robustness_map(early, "early"), dpi=50)


def test_settings_are_checked() -> None:
    with pytest.raises(SpecError, match="radius: expected a share"):
        robustness_map(problem(), at(problem(), 0.54, 0.0), radius=0.0)
    with pytest.raises(SpecError, match="budget"):
        robustness_map(problem(), at(problem(), 0.54, 0.0), budget=6)


def test_what_only_moves_along_with_the_size_of_the_changes_has_no_influence() -> None:
    found = robustness_map(problem(), at(problem(), 1.0, -1.0), budget=300)
    assert found.influences[0] < -0.99 and abs(found.influences[1]) < 0.15
    assert robustness_map(problem(), at(problem(), 1.0, -1.0), budget=7).influences[0] < -0.99


def test_what_has_one_value_is_not_changed() -> None:
    fixed = ParameterRange("x0", 0.0, 0.0)
    lag = lag_problem("G[10,10] (x <= 0.5)", free=Freedom(5, 0.1), parameters=(fixed,))
    found = robustness_map(lag, at(lag, 1.0, 0.0), budget=20)
    assert [c.name for c in found.coordinates] == ["u"]
    assert "random changes of u at once, 100 % of those up to 0.6 %" in found.text
    alone = lag_problem("G[10,10] (x <= 0.5)", inputs=0, parameters=(fixed,))
    with pytest.raises(SpecError, match="5 % of a range changes none of the values"):
        robustness_map(alone, evaluate(alone, Candidate({}, {"x0": 0.0})))


def test_items_with_numbers_far_apart_are_changed_to_items() -> None:
    items = (("init", 1), ("run", 2), ("error", 255))
    mode = ParameterRange("x0", 1.0, 255.0, kind="enumeration", items=items)
    modes = lag_problem("G[0,0] (x >= 3)", inputs=0, parameters=(mode,))
    start = evaluate(modes, Candidate({}, {"x0": 2.0}))
    near = robustness_map(modes, start, budget=100)
    assert set(near.values[:, 0]) == {1.0} and len(near.robustness) < 10
    assert 255.0 in set(robustness_map(modes, start, budget=100, radius=1.0).values[:, 0]) <= {1.0, 255.0}


def test_of_one_change_it_is_told_that_it_violates() -> None:
    found = robustness_map(problem(), at(problem(), 0.4, 0.0), budget=8)
    count = len(found.robustness)
    for below, said in ((0, "none of {} violates;"), (1, "1 of {} violates;"), (2, "2 of {} violate;")):
        robustness = np.where(np.arange(count) < below, -1.0, 1.0)
        told = said.format(f"{count} random changes of up to 2.5 % of the range")
        assert told in replace(found, robustness=robustness).text


def test_whole_numbers_are_changed_by_whole_numbers_or_not_at_all() -> None:
    def mapped(high: float, kind: ValueKind = "real", budget: int = 60) -> RobustnessMap:
        steps = ParameterRange("x0", 0.0, high, kind="integer", nominal=0.0)
        whole = lag_problem("G[10,10] (x <= 0.5)", free=Freedom(5, 0.1), parameters=(steps,))
        inputs = (replace(whole.space.inputs[0], kind=kind),)
        whole = replace(whole, space=replace(whole.space, inputs=inputs))
        return robustness_map(whole, at(whole, 1.0, 4.0), budget=budget)

    with pytest.raises(SpecError, match="budget: 7 simulations are too few to change a whole number"):
        mapped(20.0, "integer", 7)
    assert "random changes of u at once" in mapped(10.0).text
    assert set(mapped(40.0).values[:, 1]) == {2.0, 3.0, 4.0, 5.0, 6.0}
