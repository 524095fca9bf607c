from typing import Any

import pytest

from falsifier.stl import Monitor, parse
from falsifier.stl.intervals import Interval
from falsifier.stl.tell_apart import differences, tell_apart

RANGES = {"b": Interval(0, 1), "x": Interval(-10, 10)}


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("F[0,5] (x >= 3)", "G[5,5] (x >= 3)"),
        ("F[0,5] (x >= 3)", "G[0,5] (x >= 3)"),
        ("G[0,5] (x <= 3)", "G[0,10] (x <= 3)"),
        ("G[0,5] (x <= 3)", "G[0,5] (x <= 2)"),
        ("G[0,8] (b -> F[0,2] (x >= 3))", "G[0,8] (b -> G[2,2] (x >= 3))"),
        ("G[0,10] (x >= 3)", "G[0,10] (x <= 3)"),
        ("F[0,5] (x/b >= 3)", "G[5,5] (x/b >= 3)"),  # where b is 0, values are left out
    ],
)
def test_an_example_satisfies_only_one(one: str, other: str) -> None:
    a, b = parse(one), parse(other)
    found = tell_apart(a, b, step=0.5, samples=21, ranges=RANGES)
    assert found is not None
    assert Monitor(a, 0.5, 21).evaluate(found).robustness > 0
    assert Monitor(b, 0.5, 21).evaluate(found).violated
    assert all(RANGES[n].low <= c.min() and c.max() <= RANGES[n].high for n, c in found.columns.items())


def test_what_one_implies_has_no_example() -> None:
    narrow, wide = parse("G[0,10] (x <= 3)"), parse("G[0,5] (x <= 3)")
    assert tell_apart(narrow, wide, step=0.5, samples=21, ranges=RANGES) is None


def test_formulas_of_numbers_alone_differ_in_one_direction() -> None:
    grid: Any = {"step": 0.5, "samples": 3, "ranges": {}}
    assert tell_apart(parse("1 <= 2"), parse("2 <= 1"), **grid) is not None
    assert differences(parse("1 <= 2"), parse("2 <= 1"), **grid) == {1}


def test_examples_are_repeatable_and_have_few_steps() -> None:
    a, b = parse("F[0,5] (x >= 3)"), parse("G[0,5] (x >= 3)")
    first, again = (tell_apart(a, b, step=0.5, samples=21, ranges={}) for _ in range(2))
    assert first is not None and again is not None
    assert (first["x"] == again["x"]).all()
    assert (first["x"][1:] != first["x"][:-1]).sum() == 1


def test_an_example_on_a_fine_grid_is_found_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.stl.tell_apart._AT_ONCE", 5000)
    one, other = parse("G[0,1] (x <= 1)"), parse("F[0,1] (x <= 1)")
    found = tell_apart(other, one, step=0.001, samples=1001, ranges={"x": Interval(0.0, 2.0)})
    assert found is not None
    assert Monitor(one, 0.001, 1001).batch({"x": found["x"][None]})[0] < 0
