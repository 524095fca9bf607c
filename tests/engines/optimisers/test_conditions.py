"""The conditions that a formula joins at its top."""

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.engines.layout import Array
from falsifier.engines.optimisers.conditions import Conditions
from falsifier.evaluation.evaluate import Evaluation
from falsifier.stl import Monitor, Verdict, parse

JOINED = (
    ("G (x <= 1)", 1),
    ("not (G (x <= 1))", 1),
    ("G (x <= 1) or F (y >= 2)", 2),
    ("(G (x <= 1) and F (y >= 2)) or not (F (x <= 0))", 3),
    ("F (y >= 0) -> (G (x <= 1) -> F (y >= 0))", 2),
    ("G (x <= 1 or y <= 1)", 1),
    ("G (x <= 1) <-> F (y >= 2)", 1),
)


def simulated(formula: str, *, seed: int) -> Evaluation:
    x, y = np.random.default_rng(seed).normal(size=(2, 11))
    trajectory = Trajectory(np.arange(11.0), {"x": x, "y": 2.0 * y})
    verdict = Monitor(parse(formula), 1.0, 11).evaluate(trajectory)
    return Evaluation(Candidate({}, {}), verdict=verdict, trajectory=trajectory)


def values_of(conditions: Conditions, evaluation: Evaluation) -> Array:
    values = conditions.values(evaluation)
    assert values is not None
    return values[:, None]


@pytest.mark.parametrize(("formula", "count"), JOINED)
def test_the_conditions_joined_are_the_robustness(formula: str, count: int) -> None:
    conditions = Conditions(parse(formula))
    assert len(conditions.parts) == count
    for seed in range(20):
        evaluation = simulated(formula, seed=seed)
        values = values_of(conditions, evaluation)
        assert conditions.lowest(values, values) == pytest.approx(evaluation.robustness)


@pytest.mark.parametrize(("formula", "count"), JOINED)
def test_bounds_and_sizes_of_conditions(formula: str, count: int) -> None:
    conditions, rng = Conditions(parse(formula)), np.random.default_rng(3)
    for seed in range(20):
        values = values_of(conditions, simulated(formula, seed=seed))
        exact, below, above = conditions.lowest(values, values), rng.random(count), rng.random(count)
        assert conditions.lowest(values - below[:, None], values + above[:, None]) <= exact
        sizes = np.exp(rng.normal(size=(count, 1)))
        assert np.sign(conditions.lowest(values * sizes, values * sizes)) == np.sign(exact)


def test_what_was_not_simulated_tells_only_the_robustness() -> None:
    told = Evaluation(Candidate({}, {}), verdict=Verdict(0.5, 0.0, "x <= 1"))
    one, two = (Conditions(parse(formula)) for formula in ("G (x <= 1)", "G (x <= 1) or F (y >= 2)"))
    assert one.values(told) == 0.5 and two.values(told) is None
    assert one.values(Evaluation(told.candidate, status="failed")) is None
