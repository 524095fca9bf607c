from falsifier.engines import make_engine
from falsifier.evaluation.evaluate import evaluate
from falsifier.search.requirement_state import RequirementState
from falsifier.testing import lag_problem


def test_the_smallest_robustness_is_the_best_and_trajectories_are_not_kept() -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    target = RequirementState(problem, make_engine("uniform", problem, seed=0))
    evaluations = [evaluate(problem, problem.space.decode([u] * 4)) for u in (0.0, 1.0, -1.0)]
    assert [target.note(e) for e in evaluations] == [True, True, False]
    assert target.best is evaluations[1]
    assert [e.trajectory for e in target.evaluations] == [None] * 3
    assert target.remarks == ()
