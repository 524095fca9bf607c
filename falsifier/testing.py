"""Tests that every engine must pass, ready to inherit, and small problems to test on.

A test module for your own engine::

    class TestMine(EngineContract):
        def make(self, problem, seed):
            return Mine(problem, seed=seed)
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.model import Experiment, FunctionModel, ModelInfo, Variable
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom, InputRange, ParameterRange, SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict, parse

Judge = Callable[[Candidate], Evaluation]

STOP_TIME = 10.0
INTERVAL = 0.05


def lag_problem(
    formula: str = "G[0,10] (y <= 3)", *, free: bool = False, inputs: int = 1, parameters: int = 1
) -> Problem:
    """Problem with a first-order lag ``y' = sum of inputs - y``, ``y(0) = sum of parameters``.

    Inputs ``u0, u1, ...`` and parameters ``p0, ...`` range over [-2, 2]. The second output, ``mode``, is 1
    while y > 1 and 0 otherwise.

    Args:
        formula: the requirement over y, mode and the inputs.
        free: whether the parameterization of the inputs is free.
        inputs: number of inputs.
        parameters: number of parameters.
    """
    names = tuple(f"u{i}" for i in range(inputs))
    freedom = Freedom(max_control_points=100, min_interval=0.05) if free else None
    space = SearchSpace(
        tuple(InputRange(name, -2.0, 2.0, control_points=4, free=freedom) for name in names),
        tuple(ParameterRange(f"p{i}", -2.0, 2.0, nominal=0.0) for i in range(parameters)),
        STOP_TIME,
    )
    info = ModelInfo(
        "lag",
        "a first-order lag",
        variables=(
            *(Variable(name, causality="input", low=-2.0, high=2.0) for name in names),
            *(Variable(p.name, causality="parameter") for p in space.parameters),
            Variable("y", causality="output"),
            Variable("mode", kind="integer", causality="output"),
        ),
    )
    return Problem(
        FunctionModel(_lag, info),
        Requirement("R", parse(formula)),
        space,
        Experiment(STOP_TIME, INTERVAL, ("y", "mode")),
    )


def simulated(problem: Problem, margin: Callable[[NDArray[np.float64]], float]) -> Judge:
    """Return a function that evaluates candidates of a lag problem by simulation.

    Args:
        problem: a lag problem.
        margin: maps the samples of y, shape (n,), to the robustness.
    """

    def judge(candidate: Candidate) -> Evaluation:
        trajectory = problem.model.simulate(candidate.signals, candidate.parameters, problem.experiment)
        inputs = {name: s.sample(trajectory.times) for name, s in candidate.signals.items()}
        verdict = Verdict(margin(trajectory["y"]), critical_time=0.0, predicate="y <= 3")
        return Evaluation(candidate, verdict=verdict, trajectory=trajectory.with_columns(inputs))

    return judge


def drive(engine: Engine, judge: Judge, *, rounds: int, n: int = 1) -> list[Candidate]:
    """Ask for n candidates and tell their evaluations, ``rounds`` times; return all candidates in order."""
    asked: list[Candidate] = []
    for _ in range(rounds):
        candidates = engine.ask(n)
        asked += candidates
        engine.tell([judge(c) for c in candidates])
    return asked


class EngineContract:
    """Inherit from this class and define ``make``; pytest then runs every ``test_`` method on your engine."""

    rounds = 12

    def make(self, problem: Problem, seed: int) -> Engine:
        """Return the engine under test."""
        raise NotImplementedError

    def problems(self) -> Sequence[Problem]:
        """Problems to test on: fixed, free, parameters only, two inputs."""
        return (
            lag_problem(),
            lag_problem(free=True),
            lag_problem(inputs=0, parameters=2),
            lag_problem(inputs=2, parameters=0, free=True),
        )

    def test_candidates_are_admitted_by_the_space(self) -> None:
        """Candidates are within their ranges and allowed parameterizations, with origin and rationale."""
        for problem in self.problems():
            engine = self.make(problem, seed=1)
            for candidate in drive(engine, simulated(problem, _below_three), rounds=self.rounds):
                admitted = problem.space.admit(candidate)
                assert admitted.key == candidate.key
                assert candidate.origin and candidate.rationale

    def test_deterministic_for_a_seed(self) -> None:
        """The same seed and calls give the same candidates; another seed gives others."""
        for problem in self.problems():
            judge = simulated(problem, _below_three)
            runs = [drive(self.make(problem, seed), judge, rounds=self.rounds) for seed in (3, 3, 4)]
            keys = [[c.key for c in run] for run in runs]
            assert keys[0] == keys[1]
            assert keys[0] != keys[2]

    def test_asks_for_as_many_as_wanted(self) -> None:
        """``ask(n)`` returns n candidates, even if nothing has been told since the last call."""
        problem = lag_problem(free=True)
        engine = self.make(problem, seed=5)
        judge = simulated(problem, _below_three)
        for _ in range(3):
            batch = engine.ask(4)
            assert len(batch) == 4
            engine.tell([judge(c) for c in batch])
        assert len(engine.ask(3)) == 3
        assert len(engine.ask(2)) == 2

    def test_accepts_foreign_evaluations(self) -> None:
        """``tell`` accepts candidates that the engine did not propose, with other control points."""
        problem = lag_problem(free=True)
        judge = simulated(problem, _below_three)
        foreign = [
            Candidate({"u0": Signal((0.0, 2.5, 7.0), (1.0, -2.0, 0.5), "constant")}, {"p0": 0.5}, "somebody"),
            Candidate({"u0": Signal((0.0,), (2.0,), "pchip")}, {"p0": 2.0}, "somebody"),
        ]
        engine = self.make(problem, seed=6)
        engine.tell([judge(problem.space.admit(c)) for c in foreign])
        assert len(drive(engine, judge, rounds=self.rounds)) == self.rounds

    def test_survives_failures(self) -> None:
        """The engine continues after evaluations without verdict or trajectory."""
        problem = lag_problem()
        judge = simulated(problem, _below_three)
        count = 0

        def half_failing(candidate: Candidate) -> Evaluation:
            nonlocal count
            count += 1
            return judge(candidate) if count % 2 else Evaluation(candidate, "failed", reason="diverged")

        for failing in (half_failing, lambda c: Evaluation(c, "timeout", reason="too slow")):
            engine = self.make(problem, seed=7)
            assert len(drive(engine, failing, rounds=self.rounds)) == self.rounds

    def test_survives_a_plateau(self) -> None:
        """If every candidate has the same robustness, the engine does not repeat one candidate."""
        problem = lag_problem()
        engine = self.make(problem, seed=8)
        asked = drive(engine, simulated(problem, lambda y: 0.5), rounds=self.rounds)
        assert len({c.key for c in asked}) > self.rounds / 2

    def test_resumes_by_replay(self) -> None:
        """After the same calls, a new instance continues with the same candidates."""
        problem = lag_problem(free=True)
        judge = simulated(problem, _below_three)
        first, second = self.make(problem, seed=9), self.make(problem, seed=9)
        drive(first, judge, rounds=self.rounds, n=2)
        drive(second, judge, rounds=self.rounds, n=2)
        assert [c.key for c in first.ask(2)] == [c.key for c in second.ask(2)]


def _below_three(y: NDArray[np.float64]) -> float:
    return float(np.min(3.0 - y))


def _lag(
    times: NDArray[np.float64], inputs: dict[str, NDArray[np.float64]], parameters: dict[str, float]
) -> dict[str, NDArray[np.float64]]:
    step = float(times[1] - times[0])
    drive_ = np.sum([*inputs.values(), np.zeros_like(times)], axis=0)
    y = np.empty_like(times)
    y[0] = sum(parameters.values())
    for k in range(len(times) - 1):
        y[k + 1] = y[k] + step * (drive_[k] - y[k])
    return {"y": y, "mode": (y > 1.0).astype(np.float64)}
