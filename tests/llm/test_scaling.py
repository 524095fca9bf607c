"""Neutral scales."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.core.space import InputRange, ParameterRange
from falsifier.llm.scaling import (
    Scale,
    Scales,
    are_comparable,
    hidden_value,
    keeps_form,
    levels,
    real_value,
    signed_names,
    with_predicates,
)
from falsifier.stl import parse

numbers = st.floats(-1e6, 1e6)


@given(numbers, st.floats(1e-6, 1e6), st.floats(0, 1))
def test_a_value_comes_back_as_it_went(low: float, span: float, value: float) -> None:
    ranged = ParameterRange("p", low, low + span)
    real = real_value(ranged, value)
    assert ranged.low <= real <= ranged.high
    hidden = hidden_value(ranged, real)
    assert hidden_value(ranged, real_value(ranged, hidden)) == hidden
    assert hidden == pytest.approx(value, abs=1e-12 + 1e-12 * abs(low) / span)
    assert (real_value(ranged, 0.0), real_value(ranged, 1.0)) == (ranged.low, ranged.high)


def test_something_discrete_has_levels() -> None:
    assert levels(ParameterRange("p", 0.5, 5.2, kind="integer")) == (0.0, 0.25, 0.5, 0.75, 1.0)
    assert levels(InputRange("u", 1, 3, kind="enumeration", items=(("a", 1), ("b", 3)))) == (0.0, 1.0)
    assert levels(InputRange("u", 0, 1)) == levels(InputRange("u", 0, 90, kind="integer")) == ()


def test_a_declared_range_is_linear_and_what_lies_beyond_stays_inside() -> None:
    scale = Scale.over(-10.0, 250.0)
    assert scale.of(np.array([-10.0, 120.0, 185.0, 250.0])) == pytest.approx([0.2, 0.5, 0.65, 0.8])
    assert scale.number(251.0) - scale.number(250.0) == pytest.approx(0.3 / 130, rel=0.02)
    assert scale.number(1e6) < 1.0 and scale.number(-1e6) > 0.0
    assert Scale().number(-0.4) - 0.5 == -(Scale().number(0.4) - 0.5)


@given(st.lists(numbers, min_size=2, max_size=6, unique=True), numbers, st.floats(1e-3, 1e6))
def test_a_larger_value_stays_larger(values: list[float], middle: float, reach: float) -> None:
    scaled = Scale(middle, reach).of(np.sort(values))
    assert (np.diff(scaled) >= 0).all() and scaled.min() >= 0 and scaled.max() <= 1


def test_what_is_known_before_a_simulation_determines_a_scale() -> None:
    scales = Scales.of({"a": [0.0, 100.0], "b": [7.0], "c": [], "d": [1.0]}, {}, {"d": (1.0, 4.0)})
    assert scales["a"] == Scale(50.0, 65.0)
    assert scales["d"] == Scale(2.5, 1.5)
    assert scales["b"].number(7.0) == 0.5
    column = np.array([7.0, 27.0, 3.0])
    fitted = scales.fitted(dict.fromkeys("abcd", column))
    assert (fitted["a"], fitted["d"]) == (scales["a"], scales["d"])
    assert (fitted["b"], fitted["c"]) == (Scale(7.0, 26.0), Scale(15.0, 1.3 * 12.0))
    assert fitted.fitted({"b": 100 * column})["b"] == fitted["b"]
    assert scales.fitted({"b": np.full(3, 7.0)})["b"] == scales["b"]


def test_a_declared_range_that_says_nothing_is_not_used() -> None:
    wide = Scales.of({"a": [290.0, 293.0]}, {}, {"a": (1.0, 1e4)})
    assert wide["a"] == Scale(291.5, 1.3 * 1.5)
    assert Scales.of({"a": [1.0, 2.0]}, {}, {"a": (0.0, np.inf)})["a"].middle == 1.5


def test_differences_in_the_same_unit_have_one_scale() -> None:
    scales = Scales.of({"a": [-1.0, 1.0], "b": [-4.0, 4.0], "c": [0.0]}, {"a": "m", "b": "m", "c": ""}, {})
    assert scales["a"] == scales["b"] == Scale(0.0, 5.2) != scales["c"]


@pytest.mark.parametrize(
    ("predicate", "keeps", "comparable", "names"),
    [
        ("a <= 1", True, True, "+a"),
        ("1 < a", True, True, "-a"),
        ("abs(a - b) >= max(b, -2)", False, True, ""),
        ("a - 1 > 0.5", False, True, "+a"),
        ("a - b > u - (c - 3)", False, True, "+a -b -u +c"),
        ("-a > b", False, True, "-a -b"),
        ("a*b > 1", False, False, ""),
        ("a/2 > 1", False, False, ""),
        ("sqrt(a) > 1", False, False, ""),
    ],
)
def test_which_predicates_keep_their_form(predicate: str, keeps: bool, comparable: bool, names: str) -> None:
    (found,) = parse(predicate).predicates
    assert keeps_form(found) == keeps
    assert are_comparable(found) == comparable
    assert " ".join(map("".join, signed_names(found))) == names


def test_predicates_are_exchanged_wherever_they_are() -> None:
    formula, other = parse("G[0,1] (a > 1 -> F[2,3] (b < 2)) U (a > 1)"), parse("c == 0").predicates[0]
    changed = with_predicates(formula, dict.fromkeys(formula.predicates, other))
    assert str(changed) == str(parse("G[0,1] (c == 0 -> F[2,3] (c == 0)) U (c == 0)"))
