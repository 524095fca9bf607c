from collections import Counter

from falsifier.core.space import ParameterRange
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


def test_what_was_simulated_is_not_proposed_again_except_by_the_evolution_strategy() -> None:
    whole = ParameterRange("x0", 0, 19, kind="integer")
    problem = lag_problem("G[0,10] (x <= 99)", inputs=0, parameters=[whole])
    scout = Scout(problem, seed=1)
    known = [problem.space.decode([float(n)]) for n in range(12)]
    scout.tell([evaluate(problem, c) for c in known])
    new = [c.key for c in scout.ask(10) if c.origin != "cma"]
    assert len(set(new)) == len(new) == 8
    assert not set(new) & {c.key for c in known}
