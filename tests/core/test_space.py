import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import PchipInterpolator

from falsifier.core.candidate import Candidate
from falsifier.core.fitting import fit
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.signals import Signal, even_times
from falsifier.core.space import SearchSpace
from falsifier.errors import CandidateError, SpecError
from falsifier.testing import START, lag_problem

THROTTLE = InputRange("throttle", 0.0, 100.0, control_points=7, hold=0.05, unit="%")
BRAKE = InputRange("brake", 0.0, 325.0, control_points=3, interpolation="constant")
ROLL = ParameterRange("roll", 0.63, 0.89)
SPACE = SearchSpace((THROTTLE, BRAKE), (ROLL,), 50.0)


@given(st.lists(st.floats(0, 1), min_size=11, max_size=11))
def test_decode_and_encode_are_inverse(unit: list[float]) -> None:
    low, high = SPACE.bounds.T
    vector = low + np.array(unit) * (high - low)
    candidate = SPACE.decode(vector, origin="test")
    np.testing.assert_allclose(SPACE.encode(candidate), vector, rtol=0, atol=1e-12)
    assert Candidate.from_json(json.loads(json.dumps(candidate.to_json()))) == candidate
    assert fit(SPACE, candidate).candidate.key == candidate.key


def test_rounding_is_clipped_and_more_is_refused() -> None:
    vector = SPACE.bounds[:, 1].copy()
    vector[-1] += 1e-6
    assert SPACE.decode(vector).parameters["roll"] == 0.89
    vector[0] = 101
    with pytest.raises(CandidateError, match=r"'throttle' at t = 0 s: 101 is outside its range \[0, 100\]"):
        SPACE.decode(vector)


def test_unknown_and_missing_names_are_named() -> None:
    good = SPACE.decode(SPACE.bounds[:, 0])
    with pytest.raises(CandidateError, match="did you mean 'throttle'"):
        SPACE.admit(Candidate({"throtle": good.signals["throttle"]}, {}))
    with pytest.raises(CandidateError, match="'brake' is missing"):
        SPACE.admit(Candidate({"throttle": good.signals["throttle"]}, {"roll": 0.7}))
    with pytest.raises(CandidateError, match="expected 11 finite numbers, got 2"):
        SPACE.decode([1.0, 2.0])
    with pytest.raises(CandidateError, match="expected 11 finite numbers, got nan"):
        SPACE.decode([math.nan] * 11)


def test_a_free_parameterization_is_checked_against_its_limits() -> None:
    fixed = SearchSpace((InputRange("u", 0.0, 1.0, control_points=3),), (), 10.0)
    steps = Candidate({"u": Signal((0.0, 0.5, 9.0), (0.0, 1.0, 0.5), "constant")})
    with pytest.raises(CandidateError, match="expected 3 evenly spaced control points"):
        fixed.admit(steps)
    free = SearchSpace((InputRange("u", 0.0, 1.0, control_points=3, free=Freedom(3, 0.4)),), (), 10.0)
    assert free.admit(steps).signals["u"].interpolation == "constant"
    with pytest.raises(CandidateError, match="at most 3"):
        free.admit(Candidate({"u": Signal((0.0, 1.0, 2.0, 3.0), (0.0,) * 4)}))
    with pytest.raises(CandidateError, match=r"less than 0\.4 s apart"):
        free.admit(Candidate({"u": Signal((0.0, 0.3), (0.0, 1.0))}))
    with pytest.raises(CandidateError, match="after the stop time"):
        free.admit(Candidate({"u": Signal((0.0, 11.0), (0.0, 1.0))}))


GEAR = InputRange(
    "gear",
    1.0,
    7.0,
    control_points=3,
    interpolation="constant",
    kind="enumeration",
    items=(("a", 1), ("b", 3), ("c", 7)),
)
COUNT = ParameterRange("count", 0.5, 3.5, kind="integer")


@given(st.floats(1, 7), st.floats(1, 3))
def test_whole_numbers_are_admitted_whole(gear: float, count: float) -> None:
    space = SearchSpace((GEAR,), (COUNT,), 10.0)
    candidate = space.decode([gear, 1.0, 7.0, count])
    assert candidate.signals["gear"].values[0] in (1.0, 3.0, 7.0)
    assert candidate.parameters["count"] in (1.0, 2.0, 3.0)
    assert space.admit(candidate) == candidate
    assert space.decode(space.encode(candidate)) == candidate


def test_bounds_are_allowed_numbers() -> None:
    count = ParameterRange("count", 0.5, 3.7, kind="integer")
    assert (count.low, count.high) == (1.0, 3.0)
    gear = InputRange("gear", 1.5, 8.0, kind="enumeration", items=(("d", 7), ("r", 1), ("n", 3)))
    assert (gear.low, gear.high) == (3.0, 7.0)
    single = ParameterRange("single", 2.6, 3.4, kind="integer")
    space = SearchSpace((), (count, single), 1.0)
    for wanted, taken in (
        ((0.6, 2.6), (1.0, 3.0)),
        ((3.4, 3.4), (3.0, 3.0)),
        ((2.0, 3.0 - 1e-9), (2.0, 3.0)),
    ):
        candidate = space.admit(Candidate({}, dict(zip(space.names, wanted, strict=True))))
        assert tuple(candidate.parameters.values()) == taken
    with pytest.raises(CandidateError, match=r"'count': 3.7 is outside its range \[1, 3\]"):
        space.admit(Candidate({}, {"count": 3.7, "single": 3.0}))


def test_whole_numbers_are_not_interpolated_freely() -> None:
    space = SearchSpace((replace(GEAR, free=Freedom(9, 0.1)),), (), 10.0)
    held = space.admit(Candidate({"gear": Signal((0.0, 2.0), (1.2, 6.9), "constant")}))
    assert held.signals["gear"].values == (1.0, 7.0)
    with pytest.raises(CandidateError, match='cannot have linear interpolation; use "constant"'):
        space.admit(Candidate({"gear": Signal((0.0, 2.0), (1.0, 7.0), "linear")}))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"low": 1, "high": 0}, r"input 'u': expected low <= high, got \[1, 0\]"),
        ({"low": math.nan}, "input 'u': low: expected a finite number, got nan"),
        ({"high": "5"}, "input 'u': high: expected a finite number, got '5'"),
        ({"low": -1.7e308, "high": 1.7e308}, "too wide to calculate with"),
        ({"control_points": 0}, "input 'u': control_points: expected a whole number, at least 1, got 0"),
        ({"interpolation": "cubic"}, "interpolation: expected pchip, linear or constant, got 'cubic'"),
        ({"hold": 0.0}, "input 'u': hold: expected a positive number, got 0.0"),
        ({"kind": "float"}, "kind: expected real, integer, boolean or enumeration, got 'float'"),
        ({"low": 0.2, "high": 0.8, "kind": "integer"}, "contains no integer"),
        ({"kind": "enumeration", "items": (("on", 3),)}, "contains no item of the enumeration"),
    ],
)
def test_an_input_that_cannot_be_searched_is_refused_when_it_is_made(
    wrong: dict[str, Any], message: str
) -> None:
    given: dict[str, Any] = {"low": 0.0, "high": 1.0, **wrong}
    with pytest.raises(SpecError, match=message):
        InputRange("u", given.pop("low"), given.pop("high"), **given)


def test_a_range_in_decades_has_exact_ends_and_no_value_beside_them() -> None:
    wide = ParameterRange("R", 1.234567e-6, 0.3, scale="log")
    for r in (wide, ParameterRange("R", -0.3, 0.7), ParameterRange("R", 5e-324, 1.7e308, scale="log")):
        assert (r.at(0.0), r.at(1.0), r.share_of(r.low), r.share_of(r.high)) == (r.low, r.high, 0.0, 1.0)
        shares = np.linspace(0.0, 1.0, 9)
        assert r.share_of(r.at(shares)) == pytest.approx(shares, abs=1e-12)
    for value in (2.0, 434.2563620419241):  # whose powers are rounded
        single = ParameterRange("R", value, value, scale="log")
        assert single.share_of(value) == 0.0
        assert SearchSpace((), (single,), 1.0).decode([value]).parameters["R"] == value
    space = SearchSpace((), (wide,), 1.0)
    assert space.decode([1.23456e-6]).parameters["R"] == wide.low, "a rounding"
    for value in (0.0, 1e-6):  # a rounding of the width of all, and not in decades
        with pytest.raises(CandidateError, match=r"outside its range \[1\.234567e-06, 0\.3\]"):
            space.decode([value])
    assert repr(space) == "<SearchSpace: R in [1.23457e-06, 0.3] in decades; 1 s>"


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (ParameterRange, {"low": 0}, r'scale "log" needs low > 0, got \[0, 9\]; .* make scale "linear"'),
        (ParameterRange, {"kind": "integer"}, "parameter 'p': only real parameters can have"),
        (InputRange, {}, "input 'p': only real parameters can have"),
        (ParameterRange, {"scale": "ln"}, "scale: expected linear or log, got 'ln'"),
    ],
)
def test_a_scale_is_refused_where_there_are_no_decades(
    kind: type[InputRange | ParameterRange], given: dict[str, Any], message: str
) -> None:
    with pytest.raises(SpecError, match=message):
        kind("p", **{"low": 1.0, "high": 9.0, "scale": "log", **given})


def test_other_parts_of_a_space_are_checked_when_they_are_made() -> None:
    u, p = InputRange("u", 0, 1), ParameterRange("p", 2, 2)
    for make, message in (
        (lambda: ParameterRange("p", 3, 2), r"parameter 'p': expected low <= high, got \[3, 2\]"),
        (lambda: Freedom(0, 0.1), "max_control_points: expected a whole number, at least 1, got 0"),
        (lambda: Freedom(3, 0.0), "min_interval: expected a positive number"),
        (lambda: SearchSpace((u,), (p,), 0.0), "stop_time: expected a positive number"),
        (lambda: SearchSpace((u, u), (), 1.0), "'u' has two ranges"),
        (lambda: SearchSpace((u,), (ParameterRange("u", 0, 1),), 1.0), "'u' has two ranges"),
        (lambda: SearchSpace((p,), (), 1.0), "expected a tuple of InputRange"),  # type: ignore[arg-type]
        (lambda: SearchSpace([u], (), 1.0), "expected a tuple of InputRange"),  # type: ignore[arg-type]
    ):
        with pytest.raises(SpecError, match=message):
            make()


def test_a_shortest_piece_frees_all_inputs_up_to_the_stop_time() -> None:
    space = SearchSpace((InputRange("u", 0.0, 1.0), InputRange("v", 0.0, 1.0)), (), 10.0)
    assert [r.free for r in space.freed(0.1).inputs] == [Freedom(100, 0.1)] * 2
    dense = replace(space.inputs[0], control_points=7)
    (coarse,) = SearchSpace((dense,), (), 10.0).freed(4.0).inputs
    assert (coarse.control_points, coarse.free) == (2, Freedom(2, 4.0))
    for wrong in (0.0, -1.0, 11.0, math.nan):
        with pytest.raises(SpecError, match="shortest piece of an input must be positive"):
            space.freed(wrong)


HELD = Signal((0.0, 1.0), (2.0, 3.0), "constant", hold=0.5)
FREE = Signal((0.0,), (1.0,), "linear")


def test_what_is_simulated_is_the_key_whoever_proposed_it() -> None:
    one = Candidate({"a": HELD, "b": FREE}, {"p": 1.0, "q": 2.0}, "uniform", "random")
    other = Candidate({"b": FREE, "a": HELD}, {"q": 2.0, "p": 1.0}, "somebody")
    assert one.key == other.key
    assert len({one.key, other.key}) == 1, "keys can be looked up"
    assert one.key != Candidate({"a": HELD, "b": FREE}, {"p": 1.0, "q": 2.5}).key
    assert one.key != Candidate({"a": FREE, "b": FREE}, {"p": 1.0, "q": 2.0}).key


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=9), st.data())
def test_pchip_is_scipys_at_uneven_times(values: list[float], data: st.DataObject) -> None:
    gaps = data.draw(st.lists(st.floats(0.1, 9), min_size=len(values) - 1, max_size=len(values) - 1))
    times = np.concatenate([[0.0], np.cumsum(gaps)]).astype(np.float64)
    at = np.linspace(0.0, float(times[-1]), 57)
    got = Signal(tuple(times.tolist()), tuple(values)).sample(at)
    np.testing.assert_allclose(got, PchipInterpolator(times, values)(at), atol=1e-9)


def test_constant_pieces_are_right_continuous_and_the_last_value_is_kept() -> None:
    signal = Signal.evenly([1, 2, 3, 4], stop_time=8, interpolation="constant")
    assert signal.times == (0, 2, 4, 6)
    assert signal.sample(np.array([0, 1.99, 2, 3.5, 4, 6, 8])).tolist() == [1, 1, 2, 2, 3, 4, 4]
    signal = Signal((0.0, 1.0), (0.0, 10.0), "linear")
    assert signal.sample(np.array([0.0, 0.25, 1.0, 7.0])).tolist() == [0, 2.5, 10, 10]


def test_hold_samples_at_its_own_multiples_in_spite_of_rounding() -> None:
    signal = Signal((0.0, 1.0), (0.0, 1.0), "linear", hold=0.05)
    times = np.linspace(0.0, 0.2, 21)
    expected = np.repeat([0.0, 0.05, 0.10, 0.15, 0.20], 5)[:21]
    np.testing.assert_allclose(signal.sample(times), expected, atol=1e-12)


@pytest.mark.parametrize("step", [1e-13, 1e-9, 3e-3, 1e3 / 3.0])
@pytest.mark.parametrize("is_held", [False, True])
def test_every_step_of_a_simulation_of_any_length_takes_its_own_piece(step: float, is_held: bool) -> None:
    times = tuple(float(f"{k * step:.12g}") for k in range(1000))
    pieces = tuple(float(k) for k in range(1000))
    signal = Signal(times, pieces, "constant", hold=step if is_held else None)
    assert signal.sample(np.arange(1000, dtype=np.float64) * np.float64(step)).tolist() == list(pieces)
    assert signal.stepped().values == pieces
    assert signal.shortest_dwell == pytest.approx(step)


def test_between_control_points_no_value_is_outside_of_theirs() -> None:
    signal = Signal.evenly([0.1, 0.3, 0.1, 0.1], stop_time=50.0, hold=1 / 3)  # next to 50/3, by rounding
    values = signal.sample(np.linspace(0.0, 50.0, 151))
    assert (values.min(), values.max()) == (0.1, 0.3)


def test_one_point_is_a_constant() -> None:
    assert set(Signal.evenly([3.5], stop_time=10).sample(np.linspace(0, 10, 11))) == {3.5}
    assert even_times(1, stop_time=10, interpolation="pchip") == (0.0,)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ((0.0, 1.0), (1.0,), "equally many"),
        ((1.0, 2.0), (1.0, 2.0), "strictly from 0"),
        ((0.0, 0.0), (1.0, 2.0), "strictly from 0"),
    ],
)
def test_bad_control_points_are_refused(
    times: tuple[float, ...], values: tuple[float, ...], message: str
) -> None:
    with pytest.raises(SpecError, match=message):
        Signal(times, values)


def test_an_even_signal_without_values_is_refused_as_any_other() -> None:
    with pytest.raises(SpecError, match="one or more"):
        Signal.evenly([], stop_time=10)


RAMP = Signal(tuple(i / 10 for i in range(101)), tuple(i / 100 for i in range(101)), "linear")


def test_a_signal_is_sampled_at_the_control_points_of_the_spec() -> None:
    fitted = fit(lag_problem(points=3).space, Candidate({"u": RAMP}))
    assert fitted.candidate.signals["u"].values == pytest.approx((0, 0.5, 1))
    assert "u is sampled at 3 control points with linear interpolation" in fitted.notes[0]


def test_a_free_space_takes_as_many_control_points_as_it_allows() -> None:
    space = lag_problem(free=Freedom(max_control_points=50, min_interval=0.5)).space
    assert len(fit(space, Candidate({"u": RAMP})).candidate.signals["u"].times) == 21
    steps = Signal((0.0, 0.1), (0.0, 1.0), "constant")
    assert len(fit(space, Candidate({"u": steps})).candidate.signals["u"].times) == 20


@pytest.mark.parametrize(
    ("hold", "told"), [(5.0, ["u is held for 5 s"]), (None, ["u is not held"]), (2.0, [])]
)
def test_another_hold_is_said(hold: float | None, told: list[str]) -> None:
    (u,) = (space := lag_problem(points=3).space).inputs
    space = replace(space, inputs=(replace(u, hold=hold),))
    signal = Signal(space.fixed_times(u), (0.0, 1.0, 0.0), u.interpolation, 2.0)
    assert list(fit(space, Candidate({"u": signal})).notes) == told


def test_control_points_of_nanoseconds_are_not_fixed_ones_because_they_are_near_in_seconds() -> None:
    fixed = SearchSpace((InputRange("u", 0.0, 1.0, control_points=3, interpolation="linear"),), (), 1e-8)
    fixed.admit(Candidate({"u": Signal((0.0, 5e-9, 1e-8), (0.0, 1.0, 0.0), "linear")}))
    with pytest.raises(CandidateError, match=r"one at 5\.5e-09 s instead of 5e-09 s"):
        fixed.admit(Candidate({"u": Signal((0.0, 5.5e-9, 1e-8), (0.0, 1.0, 0.0), "linear")}))


def test_inputs_that_are_not_searched_are_left_out_and_said() -> None:
    fitted = fit(lag_problem().space, Candidate({"u": RAMP, "v": RAMP}))
    assert list(fitted.candidate.signals) == ["u"]
    assert any("v is not searched" in note for note in fitted.notes)


def test_a_missing_parameter_has_its_nominal_value_and_needs_one() -> None:
    space = lag_problem(points=1, parameters=[START]).space
    fitted = fit(space, Candidate({"u": Signal((0.0,), (0.5,), "linear")}))
    assert fitted.candidate.parameters == {"x0": 0.0}
    assert "x0 is not given: its nominal value, 0, is used" in fitted.notes[0]
    exact = replace(space, parameters=(replace(START, nominal=0.123456789),))
    assert "0.123456789, is used" in fit(exact, Candidate({"u": RAMP})).notes[-1]
    for nominal in (None, 99.0):  # not known, or outside the range
        unknown = replace(space, parameters=(replace(START, nominal=nominal),))
        with pytest.raises(CandidateError, match="'x0' is searched and missing"):
            fit(unknown, Candidate({"u": RAMP}))


def test_values_outside_the_range_and_missing_inputs_are_refused() -> None:
    space = lag_problem(points=2).space
    peak = Signal((0.0, 4.0, 5.0, 10.0), (0.0, 0.0, 1.5, 0.0), "linear")
    with pytest.raises(CandidateError, match=r"'u' at t = 5 s: 1.5 is outside its range \[-1, 1\]"):
        fit(space, Candidate({"u": peak}))
    with pytest.raises(CandidateError, match="'u' is searched and missing"):
        fit(space, Candidate())


def test_a_value_that_a_rounding_put_outside_fits() -> None:
    space = lag_problem(points=2).space
    rounded = Signal((0.0, 5.0, 10.0), (0.0, 1.000001, 1.000001), "linear")
    assert fit(space, Candidate({"u": rounded})).candidate.signals["u"].values == (0.0, 1.0)


def test_what_is_rounded_to_zero_has_no_sign() -> None:
    space = SearchSpace((), (ParameterRange("n", -3.0, 3.0, kind="integer"),), 10.0)
    assert str(space.admit(Candidate({}, {"n": -0.3})).parameters["n"]) == "0.0"


def test_what_is_rounded_to_fit_is_said() -> None:
    gear = InputRange(
        "u", 1.0, 7.0, kind="enumeration", items=(("Off", 1), ("On", 7)), interpolation="constant"
    )
    space = SearchSpace((gear,), (ParameterRange("n", 0.0, 5.0, kind="integer"),), 10.0)
    fitted = fit(space, Candidate({"u": Signal((0.0,), (6.0,), "constant")}, {"n": 2.6}))
    assert (fitted.candidate.signals["u"].values, fitted.candidate.parameters) == ((7,), {"n": 3})
    assert [note.split()[0] for note in fitted.notes if "rounded" in note] == ["u", "n"]
