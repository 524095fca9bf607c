"""Bounds against what random trajectories in range are worth."""

from itertools import permutations

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.stl import Monitor, parse
from falsifier.stl.implication import implies
from falsifier.stl.intervals import Interval, decided, margins
from falsifier.stl.margins import ON_LIMIT

RANGES = {"x": Interval(-1, 2), "y": Interval(0.5, 3), "b": Interval(0, 1)}
FORMULAS = [
    "x <= 1", "x >= y", "x == 1", "x != 1", "abs(x - y) <= 1", "x*y > 0", "x/y <= 4", "x^2 <= 4", "-x <= y",
    "min(x, y) >= -1", "max(x, y, 0) <= 3", "sqrt(y) <= 2", "exp(x) >= 0", "sin(x) + cos(y) <= 2", "y^x >= 0",
    "G (x <= 1)", "F (x <= 1 and y >= 1)", "x <= 1 or y <= 1", "x <= 0 -> y <= 2", "b <-> (x > 0)",
    "not (x > 3)", "(x <= 1) U (y >= 2)", "X (x <= 2)", "log(y) >= -1", "log(x) >= -1", "x/x <= 2",
]  # fmt: skip


@pytest.mark.parametrize("text", FORMULAS)
def test_no_trajectory_in_range_is_outside_the_bounds(text: str) -> None:
    formula, rng = parse(text), np.random.default_rng(3)
    bounds = margins(formula, RANGES)
    assert bounds.low <= bounds.high
    if text in ("log(x) >= -1", "x/x <= 2"):  # no value everywhere: nothing is known
        assert bounds == Interval()
        return
    monitor = Monitor(formula, 0.5, 5)
    for _ in range(40):
        columns = {
            n: np.where(rng.random(5) < 0.3, r.low, rng.uniform(r.low, r.high, 5)) for n, r in RANGES.items()
        }
        found = monitor.evaluate(Trajectory(np.linspace(0, 2, 5), columns)).robustness
        assert bounds.low - 1e-9 <= found <= bounds.high + 1e-9


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [("x <= 1", -1, 2), ("x < 2", -ON_LIMIT, 3), ("x <= 2", ON_LIMIT, 3),
     ("abs(x) <= 5", 3, 5), ("x == 4", -5, -2), ("z <= 1", -np.inf, np.inf),
     ("(y + 2.5)/10 > 0.3", -ON_LIMIT, 0.55 - 0.3)],
)  # fmt: skip
def test_bounds_of_single_signals_are_tight(text: str, low: float, high: float) -> None:
    assert margins(parse(text), RANGES) == Interval(low, high)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("G (x <= 2)", [("G (x <= 2)", True)]),
        ("G (x <= 1 -> y > 4)", [("y > 4", False)]),
        ("G (x == 1 -> y <= 1)", []),
        ("F (x > 2.5)", [("F (x > 2.5)", False)]),
        ("G (x <= 1)", []),
        ("G (b > 0 -> x <= 1)", []),
        ("G (not (b > 0 and y > 1))", []),
        ("G (b > 0 or b >= 0)", [("G (b > 0 or b >= 0)", True)]),
        ("G (b < 0 or x <= 1)", [("b < 0", False)]),
        ("G (b < 0 -> x <= 1)", [("G (b < 0 -> x <= 1)", True)]),
        ("b >= 0 <-> x <= 1", [("b >= 0", True)]),
        ("G (b >= 0 and x <= 1)", [("b >= 0", True)]),
        ("(x <= 1) and (y <= 5)", [("y <= 5", True)]),
    ],
)
def test_the_largest_parts_that_are_decided_are_named(text: str, parts: list[tuple[str, bool]]) -> None:
    assert [(str(part), holds) for part, holds in decided(parse(text), RANGES)] == parts


FOLLOWS = [
    ("x <= 3", "x <= 4"),
    ("3 >= x", "x < 4"),
    ("x < 3", "x <= 3"),
    ("not (x > 3)", "x <= 3"),
    ("G[0,8] (x <= 3)", "G[2,5] (x <= 4)"),
    ("G (x <= 3)", "G[2,5] (x <= 3)"),
    ("F[2,5] (x <= 3)", "F[0,8] (x <= 4)"),
    ("G[0,5] (x <= 3)", "F[5,8] (x <= 3)"),
    ("x <= 3 and y > 1", "y > 0"),
    ("x <= 3", "x <= 4 or y > 1"),
    ("x <= 3 or x <= 2", "x <= 3"),
    ("y > 1 -> x <= 3", "y > 2 -> x <= 4"),
    ("x <= 3", "y > 1 -> x <= 3"),
    ("not (y > 1)", "y > 2 -> x <= 3"),
    ("(x <= 3) U[2,5] (y > 1)", "(x <= 4) U[0,8] (y > 0)"),
    ("(x <= 3) U[2,5] (y > 1)", "F[1,6] (y > 0)"),
    ("X (x <= 3)", "X (x <= 4)"),
    ("not not (x <= 3)", "x <= 3"),
    ("not F[0,8] (x > 3)", "G[0,8] (x <= 3)"),
    ("not G[2,5] (x > 3)", "F[0,8] (x <= 3)"),
    ("G[0,8] (not (x > 3))", "not F[2,5] (x > 4)"),
]
OTHERS = ["x <= 3", "x <= 4", "G[0,8] (x <= 3)", "F[0,8] (x <= 3)", "G (x <= 3)", "y > 1 -> x <= 3", "x == 3"]


@pytest.mark.parametrize(
    ("first", "second"), [(b, a) for a, b in FOLLOWS if "not" not in a and "or" not in a]
)
def test_and_not_the_other_way_round(first: str, second: str) -> None:
    assert not implies(parse(first), parse(second))


@pytest.mark.parametrize(("first", "second"), FOLLOWS)
def test_what_follows_is_found(first: str, second: str) -> None:
    assert implies(parse(first), parse(second))


def test_what_is_claimed_holds_on_random_trajectories() -> None:
    formulas = [parse(text) for text in dict.fromkeys([*sum(FOLLOWS, ()), *OTHERS])]
    rng = np.random.default_rng(5)
    columns = {n: rng.uniform(0, 6, (200, 1)) * 0.3 + rng.uniform(-1, 5, (200, 9)) for n in "xy"}
    truth = [Monitor(f, 1.0, 9).batch(columns) >= 0 for f in formulas]
    claimed = [(a, b) for a, b in permutations(range(len(formulas)), 2) if implies(formulas[a], formulas[b])]
    assert len(claimed) > len(FOLLOWS)
    assert [(str(formulas[a]), str(formulas[b])) for a, b in claimed if (truth[a] & ~truth[b]).any()] == []


def test_many_parts_are_compared_without_trying_every_order() -> None:
    many = " and ".join(f"(x{i} <= {i} or y{i} <= {i})" for i in range(20))
    assert implies(parse(many), parse(many))
    assert not implies(parse(many), parse(many.replace("and", "or").replace("<=", ">")))
