import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace
from falsifier.errors import CandidateError, SpecError

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
    assert Candidate.from_json(candidate.to_json()) == candidate


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
    with pytest.raises(CandidateError, match="expected 11 numbers, got 2"):
        SPACE.decode([1.0, 2.0])


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
    for wrong in (0.0, -1.0, 11.0, math.nan):
        with pytest.raises(SpecError, match="shortest piece of an input must be positive"):
            space.freed(wrong)
