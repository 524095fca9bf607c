from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.search.budget import Spent
from falsifier.search.result import Result
from falsifier.testing import lag_problem

PROBLEM = lag_problem()
NEAR = evaluate(PROBLEM, PROBLEM.space.decode([0.8] * 4))
FOUND = evaluate(PROBLEM, PROBLEM.space.decode([1.0] * 4))


def test_the_counterexample_is_shown_and_without_one_the_best() -> None:
    falsified = Result(
        problem=PROBLEM, status="falsified", reason="", counterexample=confirm(PROBLEM, FOUND), best=NEAR
    )
    assert (falsified.falsified, falsified.shown, falsified.robustness) == (True, FOUND, FOUND.robustness)
    best = Result(problem=PROBLEM, status="not falsified", reason="", best=NEAR)
    assert (best.falsified, best.shown, best.robustness) == (False, NEAR, NEAR.robustness)


def test_without_any_simulation_nothing_is_known() -> None:
    failed = Result(problem=PROBLEM, status="failed", reason="out of order")
    assert (failed.falsified, failed.shown, failed.robustness) == (False, None, None)


def test_a_result_is_one_line_in_a_terminal() -> None:
    result = Result(problem=PROBLEM, status="not falsified", reason="", best=NEAR, spent=Spent(simulations=1))
    assert repr(result) == f"Result(LAG: not falsified, robustness {NEAR.robustness:+.6g}, 1 simulation)"
