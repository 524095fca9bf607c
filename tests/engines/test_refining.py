from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.engines.refining import COPIES, Refining, Stage
from falsifier.engines.simple import Uniform
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.problem.refinement import level_spaces
from falsifier.stl import Verdict
from falsifier.testing import FREE, EngineContract, drive, lag_problem
from tests.engines.support import doubtful

PROBLEM = lag_problem(free=FREE, points=3)


class Listening(Uniform):
    """Keeps what it is told, and may be made to suggest a candidate first."""

    def __init__(self, problem: Problem, seed: int, *, first: Sequence[Candidate] = ()) -> None:
        super().__init__(problem, seed=seed)
        self.told: list[Evaluation] = []
        self.first = list(first)
        self.begun: int | None = None
        self.doubted: list[object] = []

    def ask(self, n: int = 1) -> list[Candidate]:
        return [self.first.pop(0)] if self.first else super().ask(n)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.told += evaluations

    def begin(self, simulations: int | None) -> None:
        self.begun = simulations

    def doubt(self, confirmation: object) -> None:
        self.doubted.append(confirmation)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        return (f"told {len(self.told)} of {len(evaluations)}",) if self.told else ()


def spaces(*, free: bool) -> tuple[SearchSpace, ...]:
    return level_spaces(PROBLEM.space, free=free)


def listening(space: SearchSpace, *, first: Sequence[Candidate] = ()) -> Listening:
    return Listening(replace(PROBLEM, space=space), 1, first=first)


def judge(candidate: Candidate) -> Evaluation:
    values = [v for s in candidate.signals.values() for v in s.values]
    return Evaluation(candidate, verdict=Verdict(1 + min(values), critical_time=0.0, predicate="x"))


def constant(value: float, space: SearchSpace) -> Candidate:
    points = space.inputs[0].control_points
    signal = Signal.evenly([value] * points, stop_time=10.0, interpolation=space.inputs[0].interpolation)
    return Candidate({"u": signal}, {}, "test", "test")


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Engine:
        levels = level_spaces(problem.space, free=False)
        return Refining(
            [
                Stage(Uniform(replace(problem, space=space), seed=seed), space, 4 * k)
                for k, space in enumerate(levels)
            ]
        )


def test_a_level_is_told_the_samples_before_it_that_it_can_express() -> None:
    coarse, fine, whole = spaces(free=True)
    second, third = listening(fine), listening(whole)
    engine = Refining([Stage(listening(coarse), coarse, 0), Stage(second, fine, 3), Stage(third, whole, 5)])
    engine.begin(20)
    asked = drive(engine, judge, rounds=6)
    assert {e.candidate.key for e in second.told} == {c.key for c in asked[:5]}
    assert {e.candidate.key for e in third.told} == {c.key for c in asked}
    assert (second.begun, third.begun) == (2 + 3, 15 + 5)


def test_copies_of_the_best_stand_in_for_samples_that_a_level_cannot_express() -> None:
    coarse, held, _ = spaces(free=False)
    engine = Refining([Stage(listening(coarse), coarse, 0), Stage(listening(held), held, 5)])
    asked = drive(engine, judge, rounds=5 + COPIES + 1)
    best = sorted(asked[:5], key=lambda c: judge(c).robustness or 0.0)
    copies = asked[5 : 5 + COPIES]
    for original, copy in zip(best, copies, strict=False):
        points = held.fixed_times(held.inputs[0])
        assert copy.signals["u"].values == tuple(original.signals["u"].sample(np.array(points)))
        assert copy.rationale.startswith("one of the best samples so far")
    assert asked[-1].rationale == "uniform random"


def test_what_was_simulated_on_an_earlier_level_is_told_and_not_asked_for_again() -> None:
    coarse, fine, _ = spaces(free=True)
    first = listening(coarse, first=[constant(1.0, coarse)])
    second = listening(fine, first=[Candidate({"u": Signal((0.0,), (1.0,))}, {}, "test", "test")])
    engine = Refining([Stage(first, coarse, 0), Stage(second, fine, 1)])
    asked = drive(engine, judge, rounds=2)
    assert asked[1].rationale == "uniform random"
    assert second.told[1].candidate.signals["u"].times == (0.0,)
    assert second.told[1].robustness == judge(asked[0]).robustness


def test_a_violation_that_does_not_count_is_told_to_the_next_level_too() -> None:
    coarse, fine, _ = spaces(free=True)
    second = listening(fine)
    engine = Refining([Stage(listening(coarse), coarse, 0), Stage(second, fine, 1)])
    engine.begin(5)
    candidate = engine.ask()[0]
    doubt = doubtful(PROBLEM, judge(candidate))
    engine.doubt(doubt)
    engine.tell([judge(candidate)])
    engine.ask()
    assert second.doubted == [doubt]


def test_remarks_are_those_of_the_engines_that_were_asked() -> None:
    coarse, held, _ = spaces(free=False)
    first, second = listening(coarse), listening(held)
    engine = Refining([Stage(first, coarse, 0), Stage(second, held, 2)])
    engine.begin(20)
    told: list[Evaluation] = []
    for _ in range(2 + COPIES + 1):
        told += [judge(c) for c in engine.ask()]
        engine.tell(told[-1:])
    assert engine.remarks(told) == ("told 2 of 5", "told 3 of 5")
