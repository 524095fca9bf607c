"""What must fail together, or for long, and how close a trajectory came to that."""

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.core.words import listed
from falsifier.evaluation.evaluate import compiled
from falsifier.llm.prompts.together import (
    Side,
    apart,
    came_nearer,
    closest,
    longest_failure,
    near_misses,
    recurring,
)
from falsifier.stl import parse

TIMES = np.linspace(0.0, 10.0, 11)
TRAJECTORY = Trajectory(TIMES, {"x": TIMES.copy(), "y": np.where(TIMES < 4, 5.0, 0.0)})


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("G (x <= 6 or y <= 2)", [("x <= 6 fails", 7, "y <= 2"), ("y <= 2 fails", 3, "x <= 6")]),
        ("G (x >= 7 -> y <= 2)", [("x >= 7 holds", 7, "y <= 2"), ("y <= 2 fails", 3, "x >= 7")]),
        ("not F (x >= 7 and y >= 3)", [("x >= 7 holds", 7, "y >= 3"), ("y >= 3 holds", 3, "x >= 7")]),
        (
            "G (x >= 5 and x <= 9 -> not (x >= 7 and y >= 1))",
            [("x >= 5 holds, x <= 9 holds and x >= 7 holds", 7, "y >= 1")],
        ),
        (
            "G[0,8] (x >= 5 -> F[0,2] (y >= 2) or x <= 8)",
            [("x >= 5 holds and F[0,2] (y >= 2) fails", 8, "x <= 8")],
        ),
        (
            "not (F (x >= 3) and F (x >= 9 and y >= 3))",
            [("x >= 9 holds", 9, "y >= 3"), ("y >= 3 holds", 3, "x >= 9")],
        ),
        ("G (x >= 0 or y <= 2)", [("y <= 2 fails", 0, "x >= 0")]),
        (
            "not F[0,5] (x >= 1 and x <= 2 and F[0,1] (y <= 0))",
            [
                ("x >= 1 holds and x <= 2 holds", 2, "F[0,1] (y <= 0)"),
                ("x >= 1 holds and F[0,1] (y <= 0) holds", 3, "x <= 2"),
            ],
        ),
        ("G (x >= 20 or y <= 9)", []),
        # What is asked for elsewhere, too, counts only where it would violate the requirement.
        ("G[0,2] (x <= 8 or y <= 9) or G[5,10] (x <= 8)", []),
        ("G[0,2] (x <= 8 or y <= 2) or G[3,10] (x <= 8 and y <= 2)", []),
        ("G (x <= 6 and y <= 2)", []),
    ],
)
def test_how_close_a_violation_was(formula: str, told: list[tuple[str, int, str]]) -> None:
    parsed = parse(formula)
    over_time = compiled(parsed, 1.0, len(TIMES)).courses(TRAJECTORY)
    found = list(near_misses(Side(parsed, must_hold=False), TIMES, over_time))
    parts = [", ".join(str(side.part) for side in m.missing) for m in found]
    assert [(listed([*map(str, m.met)]), m.sample, p) for m, p in zip(found, parts, strict=True)] == told


def test_the_longest_failure_of_what_must_recur() -> None:
    parsed = parse("G[0,5] F[0,4] (y >= 2)")
    over_time = compiled(parsed, 1.0, len(TIMES)).courses(TRAJECTORY)
    assert recurring(parsed) == (parse("y >= 2"), 4.0, 0.0, 9.0)
    assert recurring(parse("G[1,2] G[2,3] F[1,3] (y >= 2)")) == (parse("y >= 2"), 2.0, 4.0, 8.0)
    assert longest_failure(parsed, TIMES, over_time) == (4.0, 9.0)
    assert longest_failure(parse("G (y >= 2)"), TIMES, over_time) is None


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        (
            "G (x <= 6 or y <= 9)",
            "x <= 6 fails in samples 1 and 3; y <= 9 fails in none, off by 1 in sample 2",
        ),
        (
            "not F (x >= 12 and y >= 7)",
            "x >= 12 holds in none, off by 2 in samples 1 and 3; y >= 7 holds in sample 2",
        ),
        ("G (x <= 6 or y <= 4)", ""),  # sample 1 did both, if not at one time
        ("G[0,3] (x <= 6 and y <= 9)", ""),
    ],
)
def test_in_which_samples_each_of_what_a_violation_needs_happened(formula: str, told: str) -> None:
    parsed, other = parse(formula), Trajectory(TIMES, {"x": 0 * TIMES, "y": np.full_like(TIMES, 8.0)})
    monitor = compiled(parsed, 1.0, len(TIMES))
    found = [closest(parsed, monitor.courses(t)) for t in (TRAJECTORY, other, TRAJECTORY)]
    text = apart({n: sides for n, sides in enumerate(found, start=1) if sides})
    assert text == (f"Of what a violation needs together: {told}." if told else "")


def test_samples_come_nearer_in_one_of_what_must_happen_together() -> None:
    left, right = (Side(parse(text), must_hold=True) for text in ("x >= 1", "y >= 1"))
    first, better, met = {left: 3.0, right: 1.0}, {left: 4.0, right: 0.5}, {left: 3.0, right: -2.0}
    assert came_nearer([better], [first]) and came_nearer([first], [better])
    assert not came_nearer([first], [first, better])
    assert not came_nearer([met | {right: -3.0}], [met]), "there is no nearer than met"
    assert not came_nearer([{}], [{}])


def test_of_many_samples_their_number_and_the_first_are_told() -> None:
    one, other = (Side(parse(text), must_hold=True) for text in ("x >= 1", "y >= 1"))
    samples = {n: {one: -1.0, other: 2.0} for n in range(2, 7)} | {7: {one: 3.0, other: -1.0}}
    told = "x >= 1 holds in 5 samples, first in sample 2; y >= 1 holds in sample 7"
    assert apart(samples) == f"Of what a violation needs together: {told}."
