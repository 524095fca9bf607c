import math
import random
import warnings
from dataclasses import fields

import numpy as np
import pytest

from falsifier.stl import Monitor, parse, second_monitor
from falsifier.stl.expression import Arithmetic, Call, Expression, Function, Name, Negative, Number, unit_of
from falsifier.stl.formula import FALSE, TRUE, Constant, Formula, Predicate, replaced, without_constants
from tests.stl.direct import Direct
from tests.stl.randoms import STEP, random_formula, random_trajectory


def test_signals_come_in_order_of_first_appearance() -> None:
    assert parse("G (b - a <= 3) -> max(c, a) >= b").signals == ("b", "a", "c")


def test_compared_expressions_are_signals_of_their_own() -> None:
    formula = parse("G (y5 - y4 >= 8) and abs(u) <= 3 and y4 <= 2 and y5 - y4 <= 10")
    assert [str(e) for e in formula.expressions] == ["y5 - y4", "abs(u)"]
    columns = {"y5": np.array([9.0, 8.0]), "y4": np.array([1.0, 3.0])}
    assert formula.expressions[0].evaluate(columns).tolist() == [8.0, 5.0]


def test_only_listed_names_change() -> None:
    formula = parse("G[0,2] (a + b <= 3 and F (abs(a) > c))")
    a, b, x, d, y = map(Name, "abxdy")
    assert replaced(formula, {a: x, d: y}) == parse("G[0,2] (x + b <= 3 and F (abs(x) > c))")
    assert replaced(parse("a until b > 0"), {a: b, b: a}) == parse("b until a > 0"), "exchanged"


X, Y, T = Name("x"), Name("wheel speed"), Name("T")
COLUMNS = {"x": np.array([-4.0, 0.0, 9.0]), "wheel speed": np.array([2.0, 0.0, 3.0])}


@pytest.mark.parametrize(
    ("function", "values"),
    [("abs", [4.0, 0.0, 9.0]), ("sqrt", [np.nan, 0.0, 3.0]), ("log", [np.nan, -np.inf, np.log(9.0)])],
)
def test_what_is_not_defined_is_no_number_and_no_warning(function: Function, values: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(Call(function, (X,)).evaluate(COLUMNS), values)


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (Arithmetic("*", Arithmetic("+", X, Number(1)), Y), '(x + 1)*"wheel speed"'),
        (Arithmetic("-", X, Arithmetic("-", X, X)), "x - (x - x)"),
        (Arithmetic("-", Arithmetic("-", X, X), X), "x - x - x"),
        (Arithmetic("/", X, Arithmetic("*", X, X)), "x/(x*x)"),
        (Arithmetic("^", Arithmetic("^", X, X), X), "(x^x)^x"),
        (Arithmetic("^", X, Arithmetic("^", X, X)), "x^x^x"),
        (Arithmetic("^", Number(-2), X), "(-2)^x"),
        (Arithmetic("^", X, Negative(X)), "x^-x"),
        (Negative(Arithmetic("^", X, X)), "-x^x"),
        (Arithmetic("*", Negative(X), Number(-1.5e-7)), "-x*-1.5e-07"),
        (Negative(Arithmetic("+", X, X)), "-(x + x)"),
        (Call("min", (X, Number(0.5))), "min(x, 0.5)"),
    ],
)
def test_parentheses_stand_where_they_are_needed_and_nowhere_else(expression: Expression, text: str) -> None:
    assert str(expression) == text
    assert parse(f"{text} < x") == Predicate("<", expression, X)


def test_the_unit_of_an_expression_is_that_of_its_signals() -> None:
    units = {"x": "m", "wheel speed": "km/h", "n": "1", "T": "K"}
    expressions = {
        "m": Call("abs", (Arithmetic("-", X, Number(2.0)),)),
        "km/h": Negative(Arithmetic("+", Number(3.0), Y)),
        "": Arithmetic("*", X, X),
    }
    assert {unit: unit_of(e, units) for unit, e in expressions.items()} == {u: u for u in expressions}
    assert unit_of(Name("n"), units) == ""
    # In degC, or in K if it was in degC: not in the unit of T.
    for converted in (Arithmetic("-", T, Number(273.15)), Arithmetic("+", Number(-273.15), T)):
        assert unit_of(Call("abs", (converted,)), units) == ""
    assert unit_of(Arithmetic("-", T, Number(273.15)), {"T": "°C"}) == ""
    assert unit_of(Arithmetic("+", X, Number(273.0)), units) == "m", "no temperature"


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("true and b", "b"),
        ("b or false", "b"),
        ("false -> c or b", None),
        ("true -> b", "b"),
        ("b -> false", "not b"),
        ("b -> true", None),
        ("true <-> b", "b"),
        ("b <-> false", "not b"),
        ("true U[0,5] b", "F[0,5] b"),
        ("b U[2,5] true", "G[0,2] b"),
        ("b U[0,5] true", "b"),
        ("false U b", None),
        ("b U false", None),
        ("G[0,5] (b and not false)", "G[0,5] b"),
        ("X true and b", "b"),
        ("F[0,5] true -> b", "b"),
        ('"true" and b', '"true" and b'),  # a signal of that name
    ],
)
def test_constants_disappear_when_a_formula_is_read(text: str, same: str | None) -> None:
    if same is None:
        assert parse(f"c and ({text}) or d") in (parse("d"), parse("c or d"))
    else:
        assert parse(text) == parse(same)
        assert parse(str(parse(text))) == parse(text)


def with_constants(formula: Formula, rng: random.Random) -> Formula:
    """The formula with some of its predicates replaced."""
    if isinstance(formula, Predicate):
        return rng.choice((TRUE, FALSE)) if rng.random() < 0.4 else formula
    values = [getattr(formula, field.name) for field in fields(formula)]  # type: ignore[arg-type]
    return type(formula)(*(with_constants(v, rng) if isinstance(v, Formula) else v for v in values))


def test_robustness_and_critical_time_are_those_of_the_definition_with_infinite_constants() -> None:
    judged = 0
    for seed in range(150):
        rng = random.Random(seed)
        written = with_constants(random_formula(rng, 4), rng)
        simple = without_constants(written)
        samples = round(written.horizon(STEP) / STEP) + 2
        trajectory = random_trajectory(rng, samples)
        value, at = Direct(trajectory.columns, STEP).judge(written)
        if isinstance(simple, Constant):
            assert value == (math.inf if simple.value else -math.inf), str(written)
            continue
        judged += written != simple
        verdict = Monitor(simple, STEP, samples).evaluate(trajectory)
        assert (verdict.robustness, verdict.critical_time) == (value, at * STEP), (seed, str(written))
        assert second_monitor.robustness(simple, trajectory) == value, (seed, str(written))
    assert judged > 20
