import math
import random
from dataclasses import fields

import pytest

from falsifier.stl import Monitor, parse, second_monitor
from falsifier.stl.formula import (
    FALSE,
    TRUE,
    Constant,
    Formula,
    Iff,
    Implies,
    Predicate,
    Until,
    without_constants,
)
from tests.stl.direct import Direct
from tests.stl.randoms import STEP, random_formula, random_trajectory


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
        ("true U b", "F b"),
        ("b U[2,5] true", "G[0,2] b"),
        ("b U[0,5] true", "b"),
        ("b U true", "b"),
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


def test_both_operands_may_be_constant() -> None:
    for value in (TRUE, FALSE):
        assert without_constants(Until(TRUE, value)) == value
        assert without_constants(Until(FALSE, value)) == FALSE
        assert without_constants(Iff(value, value)) == TRUE
        assert without_constants(Implies(TRUE, value)) == value
