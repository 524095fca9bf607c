import pickle
import warnings

import numpy as np
import pytest

from falsifier.stl.expression import (
    Arithmetic,
    Call,
    Expression,
    Function,
    Name,
    Negative,
    Number,
    Operator,
    number_text,
    unit_of,
)

X, Y = Name("x"), Name("wheel speed")
COLUMNS = {"x": np.array([-4.0, 0.0, 9.0]), "wheel speed": np.array([2.0, 0.0, 3.0])}


@pytest.mark.parametrize(
    ("operator", "values"),
    [
        ("+", [-2.0, 0.0, 12.0]),
        ("-", [-6.0, 0.0, 6.0]),
        ("*", [-8.0, 0.0, 27.0]),
        ("/", [-2.0, np.nan, 3.0]),
        ("^", [16.0, 1.0, 729.0]),
    ],
)
def test_operators_work_on_whole_columns(operator: Operator, values: list[float]) -> None:
    np.testing.assert_array_equal(Arithmetic(operator, X, Y).evaluate(COLUMNS), values)


@pytest.mark.parametrize(
    ("function", "values"),
    [("abs", [4.0, 0.0, 9.0]), ("sqrt", [np.nan, 0.0, 3.0]), ("log", [np.nan, -np.inf, np.log(9.0)])],
)
def test_what_is_not_defined_is_no_number_and_no_warning(function: Function, values: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(Call(function, (X,)).evaluate(COLUMNS), values)


def test_the_smallest_and_the_largest_of_several() -> None:
    three = (X, Y, Number(1.0))
    assert Call("min", three).evaluate(COLUMNS).tolist() == [-4.0, 0.0, 1.0]
    assert Call("max", three).evaluate(COLUMNS).tolist() == [2.0, 1.0, 9.0]


def test_single_numbers_and_constants_are_values_too() -> None:
    assert float(Negative(X).evaluate({"x": 3})) == -3.0
    assert float(Arithmetic("^", Number(2), Number(0.5)).evaluate({})) == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (Arithmetic("*", Arithmetic("+", X, Number(1)), Y), '(x + 1)*"wheel speed"'),
        (Arithmetic("-", X, Arithmetic("-", X, X)), "x - (x - x)"),
        (Arithmetic("-", Arithmetic("-", X, X), X), "x - x - x"),
        (Arithmetic("^", Number(-2), X), "(-2)^x"),
        (Arithmetic("^", X, Negative(X)), "x^-x"),
        (Negative(Arithmetic("+", X, X)), "-(x + x)"),
        (Call("min", (X, Number(0.5))), "min(x, 0.5)"),
    ],
)
def test_parentheses_stand_where_they_are_needed_and_nowhere_else(expression: Expression, text: str) -> None:
    assert str(expression) == text


def test_signals_are_named_once_in_order_of_appearance() -> None:
    expression = Arithmetic("+", Call("max", (Y, X)), Arithmetic("*", X, Number(2)))
    assert expression.signals == ("wheel speed", "x")
    assert [type(e).__name__ for e in expression.walk()] == [
        *("Arithmetic", "Call", "Name", "Name", "Arithmetic", "Name", "Number")
    ]


def test_equal_expressions_are_equal_keys_and_travel() -> None:
    one, other = (Arithmetic("+", X, Number(2.0)) for _ in range(2))
    assert {one: 1}[other] == 1
    assert pickle.loads(pickle.dumps(one)) == one
    assert one != Arithmetic("+", Number(2.0), X)


@pytest.mark.parametrize("value", [0.1 + 0.2, 1e-7, 120.0, -0.5, 1e300])
def test_numbers_read_back_exactly(value: float) -> None:
    assert float(number_text(value)) == value
    assert not number_text(value).endswith(".0")


def test_the_unit_of_an_expression_is_that_of_its_signals() -> None:
    units = {"x": "m", "wheel speed": "km/h", "n": "1"}
    expressions = {
        "m": Call("abs", (Arithmetic("-", X, Number(2.0)),)),
        "km/h": Negative(Arithmetic("+", Number(3.0), Y)),
        "": Arithmetic("*", X, X),
    }
    assert {unit: unit_of(e, units) for unit, e in expressions.items()} == {u: u for u in expressions}
    assert unit_of(Name("n"), units) == ""
