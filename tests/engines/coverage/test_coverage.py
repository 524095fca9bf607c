from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from bench.example_systems import function_problem
from falsifier.core.model import Kind
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.trajectory import Trajectory
from falsifier.engines.coverage import CoverageEngine
from falsifier.engines.coverage.explorer import describe
from falsifier.engines.coverage.marks import MODES, Mark, Marker
from falsifier.engines.coverage.programs import Programs
from falsifier.engines.layout import Layout, TimeGrid, planning_layout
from falsifier.evaluation.evaluate import evaluate
from falsifier.record.run import falsify
from falsifier.testing import FREE, START, drive, lag, lag_problem
from tests.engines.coverage.support import lock_problem, safe_problem

# Of uniform inputs one in 3600 opens the lock: a tenth of that is what the engine may use at most.
TENTH = 360


@pytest.mark.parametrize("free", [None, Freedom(100, 0.1)])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_sequence_that_robustness_does_not_show_is_found_step_by_step(
    free: Freedom | None, seed: int
) -> None:
    assert falsify(lock_problem(free=free), "coverage", seed=seed, budget=TENTH).falsified


@pytest.mark.parametrize("seed", range(4))
def test_values_in_narrow_bands_are_used_again_once_they_are_found(seed: int) -> None:
    assert falsify(safe_problem(), "coverage", seed=seed, budget=100).falsified


@pytest.mark.parametrize("points", [1, 3])
def test_nothing_is_simulated_twice(points: int) -> None:
    problem = lag_problem("G[0,10] (x <= 99)", points=points)
    asked = drive(CoverageEngine(problem, seed=2), partial(evaluate, problem), rounds=40)
    assert len({c.key for c in asked}) == 40


def test_a_small_space_is_searched_as_a_whole() -> None:
    problem = lag_problem(
        "G[0,10] (x <= 99)", inputs=0, parameters=[ParameterRange("x0", -4, 5, kind="integer")]
    )
    asked = drive(CoverageEngine(problem, seed=2), partial(evaluate, problem), rounds=14)
    assert len({c.key for c in asked[:10]}) == 10
    assert len(asked) == 14, "then it repeats"


def lock_marks(stage: list[float], opened: list[float]) -> dict[Mark, float]:
    times = np.linspace(0.0, 0.5 * (len(stage) - 1), len(stage))
    columns = {"stage": np.array(stage), "open": np.array(opened)}
    return Marker(lock_problem()).marks(Trajectory(times, columns))


def test_values_changes_and_modes_are_marks_with_the_time_of_their_first_occurrence() -> None:
    marks = lock_marks([0, 1, 0, 1, 2], [0, 0, 0, 0, 1])
    assert marks[Mark("stage", ("is", 0.0))] == 0.0
    assert marks[Mark("stage", ("changes", 0.0, 1.0, 1))] == 0.5
    assert marks[Mark("stage", ("changes", 0.0, 1.0, 2))] == 1.5
    assert marks[Mark(MODES, ("stage = 2", "open = 1"))] == 2.0
    assert Mark("open", ("is", 1.0)) in marks
    assert Mark(MODES, ("stage = 0", "open = 1")) not in marks


def test_the_order_of_changes_and_the_time_between_them_are_marks() -> None:
    soon = lock_marks([0, 1, 1, 1, 1, 1], [0, 0, 1, 1, 1, 1])
    late = lock_marks([0, 1, 1, 1, 1, 1], [0, 0, 0, 0, 0, 1])
    other = lock_marks([0, 0, 1, 1, 1, 1], [0, 1, 1, 1, 1, 1])
    pairs = [{m for m in marks if m.what[0] == "after"} for marks in (soon, late, other)]
    assert all(len(found) == 1 for found in pairs)
    assert len(set.union(*pairs)) == 3


def test_a_change_comes_after_those_of_the_signals_that_changed_last() -> None:
    names = [f"d{k}" for k in range(12)]
    steps = {name: (np.arange(13) > k).astype(float) for k, name in enumerate(names)}
    steps["d0"][9:] = 0.0  # again, at the time of d8
    outputs: dict[str, Kind] = dict.fromkeys(names, "boolean")
    problem = function_problem(lambda *_: steps, "G (d0 < 2)", (), (), outputs, 12.0, 1.0)
    marks = Marker(problem).marks(Trajectory(np.arange(13.0), steps))
    assert [m.what[3] for m in marks if m.source == "d11" and m.what[0] == "after"] == ["d0", *names[4:11]]


def test_a_signal_that_chatters_does_not_hide_the_others() -> None:
    count = 5000
    opened = np.zeros(count)
    opened[3] = 1
    marks = lock_marks((np.arange(count) % 2.0).tolist(), opened.tolist())
    assert len(marks) < 100
    assert Mark("open", ("changes", 0.0, 1.0, 1)) in marks


def test_levels_and_closeness_to_a_threshold_count_in_octaves() -> None:
    marker = Marker(lag_problem("G[0,10] (x <= 0.9)"))
    times = np.linspace(0.0, 10.0, 101)

    def found(scale: float) -> set[Mark]:
        x = scale * (1 - np.exp(-times))
        return set(marker.marks(Trajectory(times, {"x": x, "u": np.ones(101)})))

    assert {m.what[0] for m in found(0.85) - found(0.5)} == {"up", "near"}
    assert not {m.source for m in found(0.5)} & {"u"}
    assert any(m.what[0] == "changes" for m in found(0.95)), "the predicate became false"


def test_of_thousands_of_signals_those_of_the_formula_and_some_others_are_looked_at() -> None:
    kinds: dict[str, Kind] = {name: "real" for name in (*(f"y{i}" for i in range(2000)), "x")}
    u = InputRange("u", 0.0, 1.0)
    marker = Marker(function_problem(lag, "G[0,10] (x <= 0.9)", (u,), (), kinds, 10.0, 0.1))
    assert list(marker.kinds) == [*(f"y{i}" for i in range(200)), "x"]


@given(
    st.lists(
        st.sampled_from([0.0, 1e-300, -1.0, 2.0, 1e300, np.inf, np.nan, -np.inf]), min_size=2, max_size=9
    )
)
@example([0.0, float(np.nextafter(2.0**-10, 0.0))])  # its logarithm is rounded up to that of 2 ** -10
def test_any_numbers_have_marks(values: list[float]) -> None:
    marker = Marker(lag_problem("G[0,10] (x <= 0.9)"))
    times = np.linspace(0.0, 1.0, len(values))
    marker.marks(Trajectory(times, {"x": np.array(values), "u": np.zeros(len(values))}))


def test_marks_are_said_in_words() -> None:
    assert describe(Mark("gear", ("is", 3.0))) == "gear = 3"
    assert describe(Mark("gear", ("changes", 1.0, 2.0, 2))) == "gear change from 1 to 2 2 times"
    assert (
        describe(Mark("x", ("after", 0.0, 1.0, "y", 1.0, 0.0, 3)))
        == "x change from 0 to 1 after y from 1 to 0"
    )
    assert describe(Mark("x > 3", ("near", 2))) == "x > 3 come close to its threshold"
    assert describe(Mark("x", ("up", -2))) == "x go up"
    assert describe(Mark(MODES, ("gear = 1", "brake = 0"))) == "gear = 1 and brake = 0"


GRID = TimeGrid(0.2, 50, 50)


def layout_of(*, inputs: int) -> Layout:
    return planning_layout(lag_problem(inputs=inputs, free=FREE, parameters=[START]).space, GRID)


def drawn(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("time", [0.0, 3.1, 9.99])
@pytest.mark.parametrize("inputs", [1, 2])
def test_what_follows_a_time_is_drawn_again_and_what_precedes_it_is_kept(time: float, inputs: int) -> None:
    layout = layout_of(inputs=inputs)
    programs = Programs(layout)
    changed = False
    for seed in range(20):
        point = programs.fresh(drawn(seed))
        for other in (
            programs.another_end(drawn(seed + 100), point, time),
            programs.repeated(drawn(seed), point, time, programs.fresh(drawn(seed + 50)), (1.0, 4.0)),
            programs.tried_again(drawn(seed), point, time, 1.0),
        ):
            for coding, group in zip(layout.codings, layout.groups, strict=False):
                kept = np.asarray(coding.times) <= time
                assert (other[group][kept] == point[group][kept]).all()
            assert other.min() >= 0.0 and other.max() <= 1.0
            changed |= bool((other != point).any())
    assert changed


def test_the_way_to_a_step_returns_after_each_try() -> None:
    way, point = [0.11, 0.22, 0.33], np.full(50, 0.5)
    point[:3] = way
    tried = Programs(layout_of(inputs=1)).tried_again(drawn(0), np.append(point, 0.5), 0.4, 0.6)[:50]
    assert sum(tried[k : k + 3].tolist() == way for k in range(48)) > 3


def test_discrete_inputs_take_their_values_only() -> None:
    programs = Programs(planning_layout(lock_problem(free=Freedom(100, 0.1)).space, GRID))
    point = programs.fresh(drawn(1))
    for seed in range(50):
        point = programs.another_end(drawn(seed), point, 2.0)
        assert point * 5 == pytest.approx(np.round(point * 5))


def test_values_are_drawn_between_levels_that_are_known() -> None:
    layout = layout_of(inputs=1)
    (ranged,) = layout.space.inputs
    width = ranged.high - ranged.low
    low, high = ranged.low + 0.700 * width, ranged.low + 0.701 * width
    levels = {ranged.name: [low, high, ranged.low, ranged.high + 1.0], "another": [0.0]}
    aimed, plain = (
        np.concatenate([p.fresh(drawn(seed))[layout.groups[0]] for seed in range(40)])
        for p in (Programs(layout, levels), Programs(layout))
    )
    inside = [np.mean((values >= 0.6999) & (values <= 0.7011)) for values in (aimed, plain)]
    assert inside[0] > 0.15
    assert inside[1] < 0.02
    assert np.mean(aimed == 0.0) > 0.05, "bounds are still tried"


def test_values_at_which_something_happened_are_used_again() -> None:
    layout = layout_of(inputs=2)
    programs = Programs(layout)
    point = np.full(layout.dimension, 0.7)
    first, second = layout.groups[:2]
    point[first[:10]], point[second] = 0.3, 1.0
    programs.remember(point, 2.0, 0.1)
    fresh = np.array([programs.fresh(drawn(seed)) for seed in range(40)])
    for value in (0.3, 0.7):
        assert np.mean(fresh[:, first] == value) > 0.15, "before and after the change that may have caused it"
    assert np.mean(fresh[:, second] == 0.7) == 0.0
    assert np.mean(fresh[:, second] == 1.0) < 0.5, "bounds are drawn often enough"
