"""The way down to what decided, and which operand is taken on ties."""

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.stl import parse
from falsifier.stl.compiler import compile_formula
from falsifier.stl.evaluator import fill
from falsifier.stl.margins import ON_LIMIT
from falsifier.stl.witness import Waypoint, path_to_decider

TIMES = np.arange(6.0)


def way(text: str, **columns: list[float]) -> list[Waypoint]:
    program = compile_formula(parse(text), step=1.0, samples=6)
    trajectory = Trajectory(TIMES, {name: np.array(c) for name, c in columns.items()})
    return path_to_decider(program.root, fill(program, trajectory, np.empty(program.size)))


X = [3.0, 1.0, 2.0, 1.0, 5.0, 4.0]


def test_the_way_goes_through_every_operator_with_its_window() -> None:
    found = way("G[0,2] F[1,3] (not (x <= 2))", x=X)
    assert [(str(w.part.formula)[0], w.sample, w.window) for w in found] == [
        ("G", 0, (0, 2)),
        ("F", 0, (1, 3)),
        ("n", 2, None),
        ("x", 2, None),
    ]
    assert [w.value for w in found] == [-ON_LIMIT, -ON_LIMIT, -ON_LIMIT, ON_LIMIT]


@pytest.mark.parametrize(
    ("text", "sample"),
    [("G[0,5] (x >= 0)", 1), ("F[0,3] (x <= 2)", 1), ("X (x >= 0)", 1), ("G[2,5] (x <= 5)", 4)],
)
def test_the_earliest_sample_is_taken_on_ties(text: str, sample: int) -> None:
    assert way(text, x=X)[-1].sample == sample


@pytest.mark.parametrize(
    ("text", "decider"),
    [
        ("x <= 4 and y <= 4", "x <= 4"),  # a tie
        ("x <= 5 and y <= 4", "y <= 4"),
        ("x <= 4 or y <= 4", "x <= 4"),  # a tie
        ("x <= 4 or y <= 5", "y <= 5"),
        ("x > 4 -> y <= 4", "x > 4"),  # a tie
        ("x > 4 -> y <= 5", "y <= 5"),
        ("x > 3 <-> y > 3", "x > 3"),  # a tie
        ("x > 1 <-> y > 2.5", "y > 2.5"),
    ],
)
def test_connectives_go_to_the_operand_that_decided_the_left_one_on_ties(text: str, decider: str) -> None:
    assert str(way(text, x=[3.0] * 6, y=[3.0] * 6)[-1].part.formula) == decider


@pytest.mark.parametrize(
    ("right", "decider", "sample"),
    [
        ([0.0, 0.0, 4.0, 0.0, 0.0, 0.0], "x >= 0", 1),  # x was lowest on the way
        ([0.0, 0.5, 0.0, 0.0, 0.0, 0.0], "y >= 0", 1),
        ([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], "x >= 0", 1),  # a tie, with x lowest before y is at its best
        ([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], "x >= 0", 1),  # a tie
    ],
)
def test_until_goes_to_the_smaller_operand_the_left_one_on_ties(
    right: list[float], decider: str, sample: int
) -> None:
    last = way("(x >= 0) U[1,2] (y >= 0)", x=X, y=right)[-1]
    assert (str(last.part.formula), last.sample) == (decider, sample)
