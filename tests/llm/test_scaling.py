"""Neutral scales."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.core.space import InputRange, ParameterRange
from falsifier.llm.scaling import Scales, hidden_value, keeps_form, levels, real_value, with_predicates
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
    assert levels(ParameterRange("p", 0.5, 3.2, kind="integer")) == pytest.approx(
        (0.185185, 0.555556, 0.925926)
    )
    assert levels(InputRange("u", 1, 3, kind="enumeration", items=(("a", 1), ("b", 3)))) == (0.0, 1.0)
    assert levels(InputRange("u", 0, 1)) == levels(InputRange("u", 0, 90, kind="integer")) == ()


def test_what_is_compared_or_has_a_unit_in_common_has_one_scale() -> None:
    formula = parse("G[0,1] (a - b <= 4) and G[0,1] (c >= 2 or d > 0)")
    scales = Scales.of(formula, ("a", "b", "c", "d", "e"), {"c": "m", "e": "m"}, set())
    assert {frozenset("ab"), frozenset("ce"), frozenset("d")} == set(scales.groups)
    assert (scales["a"], scales["b"], scales["c"], scales["e"]) == (5.2, 5.2, 2.6, 2.6)
    assert scales["d"] == 1.0 and "d" not in scales.constants
    fitted = scales.fitted({"d": 10.0, "a": 1e9})
    assert (fitted["d"], fitted["a"]) == (13.0, 5.2)
    assert fitted.fitted({"d": 99.0})["d"] == 13.0


@pytest.mark.parametrize(
    ("predicate", "keeps"),
    [
        ("a <= 1", True),
        ("abs(a - b) >= max(b, -2)", True),
        ("u > 0.5", True),
        ("u - 1 > 0.5", False),
        ("a > u", False),
        ("a*b > 1", False),
        ("a/2 > 1", False),
        ("sqrt(a) > 1", False),
    ],
)
def test_which_predicates_keep_their_form(predicate: str, keeps: bool) -> None:
    (found,) = parse(predicate).predicates
    assert keeps_form(found, {"u"}) == keeps


def test_predicates_are_exchanged_wherever_they_are() -> None:
    formula, other = parse("G[0,1] (a > 1 -> F[2,3] (b < 2)) U (a > 1)"), parse("c == 0").predicates[0]
    changed = with_predicates(formula, dict.fromkeys(formula.predicates, other))
    assert str(changed) == str(parse("G[0,1] (c == 0 -> F[2,3] (c == 0)) U (c == 0)"))
