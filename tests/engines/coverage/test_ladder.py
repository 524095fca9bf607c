from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.engines.coverage.ladder import Ladder
from falsifier.engines.coverage.programs import Programs
from falsifier.engines.layout import Array, TimeGrid, planning_layout
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict, parse
from tests.engines.coverage.support import lock_problem

TIMES = np.linspace(0.0, 10.0, 11)
SOON, LATE = np.array([0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]), np.array([0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2])


def ladder_of(formula: str) -> tuple[Ladder, dict[str, Array]]:
    """Return a ladder, and the points of an input that makes one step soon and of one that makes two late."""
    problem = replace(lock_problem(), requirement=Requirement("R", parse(formula)))
    layout = planning_layout(problem.space, TimeGrid.of(problem))
    points = {"soon": np.full(layout.dimension, 0.2), "late": np.full(layout.dimension, 0.4)}
    return Ladder(problem, Programs(layout)), points


def learn(ladder: Ladder, point: Array, stage: Array, predicate: str, robustness: float) -> None:
    trajectory = Trajectory(TIMES, {"stage": stage.astype(float), "open": np.zeros(11)})
    at = int(np.argmax(stage))
    values = {"stage": float(stage[at])}
    ladder.learn(point, trajectory, Verdict(robustness, float(TIMES[at]), predicate, values))


@pytest.mark.parametrize(
    ("formula", "predicate"), [("G (stage <= 3)", "stage <= 3"), ("G (not stage > 3)", "stage > 3")]
)
def test_the_last_step_at_the_end_leaves_the_way_to_one_that_was_made_soon(
    formula: str, predicate: str
) -> None:
    ladder, points = ladder_of(formula)
    learn(ladder, points["soon"], SOON, predicate, 2.0)
    learn(ladder, points["late"], LATE, predicate, 1.0)
    asked = [ladder.propose(np.random.default_rng(seed)).rationale for seed in range(100)]
    assert {why.split(" s,")[0] for why in asked} == {
        "the input that made a margin of 1 at 10",
        "the input that made a margin of 2 at 1",
    }


def test_what_reached_the_lowest_step_in_time_is_gone_on_from() -> None:
    ladder, points = ladder_of("G (stage <= 3)")
    learn(ladder, points["late"], LATE, "stage <= 3", 1.0)
    learn(ladder, points["soon"], SOON + (np.arange(11) > 1), "stage <= 3", 1.0)
    asked = [ladder.propose(np.random.default_rng(seed)).rationale for seed in range(50)]
    assert sum("the robustness 1 at" in why for why in asked) > 30


@pytest.mark.parametrize(("samples", "simulations"), [(100, 1), (20, 60)], ids=["in one", "in all"])
def test_a_predicate_with_a_slope_has_no_steps(samples: int, simulations: int) -> None:
    ladder, points = ladder_of("G (stage <= 3)")
    for top in np.linspace(1.9, 2.0, simulations):
        stage = np.linspace(0, top, samples)
        trajectory = Trajectory(np.linspace(0.0, 9.9, samples), {"stage": stage, "open": np.zeros(samples)})
        ladder.learn(points["soon"], trajectory, Verdict(1.0, 9.9, "stage <= 3", {"stage": 2.0}))
    asked = {ladder.propose(np.random.default_rng(seed)).rationale.split(" at")[0] for seed in range(20)}
    assert asked == {"the input that made the robustness 1"}


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 1.7e308])
def test_no_number_warns(value: float) -> None:
    ladder, points = ladder_of("G (stage <= open)")
    columns = {"stage": np.where(TIMES == 3, value, 0.0), "open": np.where(TIMES == 3, -value, 0.0)}
    values = {"stage": value, "open": -value}
    ladder.learn(points["soon"], Trajectory(TIMES, columns), Verdict(1.0, 3.0, "stage <= open", values))
    assert ladder.propose(np.random.default_rng(0)).rationale
