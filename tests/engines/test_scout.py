from collections import Counter

from falsifier.engines.scout import Scout
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.testing import EngineContract, lag_problem


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Scout:
        return Scout(problem, seed=seed)


def test_every_member_has_the_same_share_and_learns_from_all() -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    scout = Scout(problem, seed=1)
    origins: Counter[str] = Counter()
    for _ in range(5):
        candidates = scout.ask(8)
        origins.update(c.origin for c in candidates)
        scout.tell([evaluate(problem, c) for c in candidates])
    assert origins == {"corners": 10, "coverage": 10, "cma": 10, "sobol": 10}
    known = [c for c in scout.ask(4) if c.origin == "coverage"]
    assert all("nothing has been reached yet" not in c.rationale for c in known)
