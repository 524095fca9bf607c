import numpy as np

from falsifier.engines.coverage.explorer import Explorer, describe
from falsifier.engines.coverage.marks import MODES, Mark
from falsifier.engines.layout import TimeGrid, planning_layout
from falsifier.evaluation.evaluate import evaluate
from tests.engines.coverage.support import lock_problem

GRID = TimeGrid.over(10.0, 10.0, cells=100, shortest=0.1)


def test_it_continues_from_what_reached_most_and_counts_the_tries() -> None:
    problem = lock_problem()
    layout = planning_layout(problem.space, GRID)
    explorer = Explorer(problem, layout)
    rng = np.random.default_rng(2)
    assert "nothing has been reached yet" in explorer.propose(rng).why
    stages = []
    for _ in range(80):
        idea = explorer.propose(rng)
        trajectory = evaluate(
            problem, layout.candidate(idea.point, origin="t", rationale=idea.why)
        ).trajectory
        assert trajectory is not None
        explorer.learn(idea.point, trajectory, 1.0, 0.0)
        stages.append(trajectory["stage"].max())
    assert max(stages) >= 4, "of uniform inputs one in 60 reaches stage 3"
    assert np.mean(stages[40:]) > np.mean(stages[:40]), "it does not forget"


def test_it_goes_on_from_when_the_lowest_robustness_was_decided() -> None:
    problem = lock_problem()
    layout = planning_layout(problem.space, GRID)
    explorer = Explorer(problem, layout)
    rng = np.random.default_rng(0)
    stages: list[int] = []
    for turn in range(60):
        idea = explorer.propose_lower(rng) if turn else explorer.propose(rng)
        assert not stages or f"robustness {7 - max(stages)}" in idea.why
        candidate = layout.candidate(idea.point, origin="t", rationale=idea.why)
        trajectory = evaluate(problem, candidate).trajectory
        assert trajectory is not None
        stages.append(int(trajectory["stage"].max()))
        reached = float(trajectory.times[np.argmax(trajectory["stage"])])
        explorer.learn(idea.point, trajectory, 7.0 - stages[-1], reached)
    assert max(stages) >= 4, "of uniform inputs one in 60 reaches stage 3"


def test_marks_are_said_in_words() -> None:
    assert describe(Mark("gear", ("is", 3.0))) == "gear = 3"
    assert describe(Mark("gear", ("changes", 1.0, 2.0, 2))) == "gear change from 1 to 2 2 times"
    assert (
        describe(Mark("x", ("after", 0.0, 1.0, "y", 1.0, 0.0, 3)))
        == "x change from 0 to 1 after y from 1 to 0"
    )
    assert describe(Mark("x > 3", ("near", 2))) == "x > 3 come close to its threshold"
    assert describe(Mark("x", ("up", -2))) == "x go up"
    assert describe(Mark(MODES, ("gear = 1", "brake = 0"))) == "gear = 1 and brake = 0"
