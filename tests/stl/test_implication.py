from itertools import permutations

import numpy as np
import pytest

from falsifier.stl import Monitor, parse
from falsifier.stl.implication import implies

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
