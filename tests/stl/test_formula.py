import dataclasses

import numpy as np
import pytest

from falsifier.stl import parse
from falsifier.stl.expression import Name
from falsifier.stl.formula import Always, Formula, Predicate


def test_signals_come_in_order_of_first_appearance() -> None:
    assert parse("G (b - a <= 3) -> max(c, a) >= b").signals == ("b", "a", "c")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("x <= 3", 0.0),
        ("G[0,65] F[0,30] G[0,5] (x >= 8)", 100.0),
        ("G[0,10] (x >= 8) and F[5,30] (x >= 3)", 30.0),
        ("X X G[0,2] x <= 3", 2.2),
        ("(G[0,3] b) U[1,2] F[0,7] b", 9.0),
        ("G[0,2] F b", 2.0),
    ],
)
def test_horizon(text: str, seconds: float) -> None:
    assert parse(text).horizon(0.1) == pytest.approx(seconds)


def test_formulas_are_frozen_and_can_be_walked() -> None:
    formula = parse("G[0,10] (x <= 3 -> F[1,2] (y >= 0))")
    assert [type(f).__name__ for f in formula.walk()] == [
        "Always", "Implies", "Predicate", "Eventually", "Predicate",
    ]  # fmt: skip
    assert [str(p) for p in formula.predicates] == ["x <= 3", "y >= 0"]
    assert isinstance(formula, Always)
    with pytest.raises(dataclasses.FrozenInstanceError):
        formula.window = None  # type: ignore[misc]


def test_compared_expressions_are_signals_of_their_own() -> None:
    formula = parse("G (y5 - y4 >= 8) and abs(u) <= 3 and y4 <= 2 and y5 - y4 <= 10")
    assert [str(e) for e in formula.expressions] == ["y5 - y4", "abs(u)"]
    columns = {"y5": np.array([9.0, 8.0]), "y4": np.array([1.0, 3.0])}
    assert formula.expressions[0].evaluate(columns).tolist() == [8.0, 5.0]


def test_an_expression_outside_its_domain_is_no_number_and_no_warning() -> None:
    formula = parse("sqrt(x) + 1/x <= 3")
    assert np.isnan(formula.expressions[0].evaluate({"x": np.array([-1.0])})).all()


def test_equal_formulas_are_equal_keys() -> None:
    counts: dict[Formula, int] = {parse("x <= 3.0"): 1}
    assert counts[Predicate("<=", Name("x"), parse("x <= 3").predicates[0].right)] == 1
