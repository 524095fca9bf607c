import pytest

from falsifier.engines.surrogate import Surrogate
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.testing import drive
from tests.engines.support import HASTY, wide_problem


class TestForesight:
    """What the surrogate foretells."""

    def trained(self, formula: str = "G[0,10] (x <= 9)") -> tuple[Problem, Surrogate]:
        made = wide_problem(formula)
        engine = Surrogate(made, seed=1, settings=HASTY)
        drive(engine, lambda c: evaluate(made, c), rounds=10)
        return made, engine

    @pytest.mark.parametrize(
        "formula",
        [
            "G[0,10] (x <= 9)",
            "F[2,8] (x >= 9)",
            "G[0,10] (x <= 9 and u >= -9)",
            "G[0,5] (F[0,2] (x <= 1.5)) or x > 20",
            "not F[0,10] (x > 9)",
        ],
    )
    def test_verdicts_are_those_of_the_simulation(self, formula: str) -> None:
        made, engine = self.trained(formula)
        found = [made.space.decode(point) for point in ([2.0, 2.0, -2.0, -2.0], [-1.5, 0.2, 1.9, 1.0])]
        for foretold, candidate in zip(engine.foresee(found), found, strict=True):
            true = evaluate(made, candidate).verdict
            assert true is not None
            assert foretold.robustness == pytest.approx(true.robustness, abs=0.4)
            assert foretold.predicate == true.predicate
            assert foretold.critical_time == pytest.approx(true.critical_time, abs=1.0)
        assert 0 <= engine.recent_error < 1

    def test_asking_changes_nothing(self) -> None:
        (made, one), (_, other) = self.trained(), self.trained()
        one.foresee([made.space.decode([1.0] * 4)])
        assert [c.key for c in one.ask(3)] == [c.key for c in other.ask(3)]

    def test_nothing_is_foretold_from_nothing(self) -> None:
        made = wide_problem()
        assert Surrogate(made, seed=0, settings=HASTY).foresee([made.space.decode([0.0] * 4)]) == []


def test_predictions_without_simulation_rank_inputs() -> None:
    problem = wide_problem()
    engine = Surrogate(problem, seed=0)
    assert engine.foresee(engine.ask(2)) == []
    for _ in range(6):
        (candidate,) = engine.ask()
        engine.tell([evaluate(problem, candidate)])
    constants = [
        engine.layout.candidate(engine.layout.constant([level]), origin="t", rationale="t")
        for level in (0.0, 0.5, 1.0)
    ]
    predicted = [verdict.robustness for verdict in engine.foresee(constants)]
    true = [evaluate(problem, c).robustness for c in constants]
    assert predicted == pytest.approx(true, abs=1.0)
    assert predicted == sorted(predicted, reverse=True)
