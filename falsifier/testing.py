"""Tests that every engine must pass, ready to inherit, and small problems to test on.

A test module for your own engine::

    from falsifier.testing import EngineContract

    class TestMine(EngineContract):
        def make(self, problem, seed):
            return Mine(problem, seed=seed)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.experiment import Experiment
from falsifier.core.function_model import FunctionModel
from falsifier.core.model import ModelInfo, Variable
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import Verdict

Array = NDArray[np.float64]
Response = Callable[[Array, dict[str, Array], dict[str, float]], Mapping[str, Array]]
Judge = Callable[[Candidate], Evaluation]

STOP_TIME = 10.0
INTERVAL = 0.1
# Wide enough for everything that engines propose over ten seconds.
FREE = Freedom(max_control_points=100, min_interval=INTERVAL)
START = ParameterRange("x0", -1.0, 1.0, nominal=0.0)
BIAS = ParameterRange("bias", -1.0, 1.0, nominal=0.0)


def lag(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Respond as ``x' = gain * (sum of inputs) + bias - x`` does from ``x(0) = x0``, by explicit Euler."""
    drive_ = parameters.get("gain", 1.0) * sum(inputs.values(), np.zeros_like(times))
    drive_ += parameters.get("bias", 0.0)
    x = np.empty_like(times)
    x[0] = parameters.get("x0", 0.0)
    for k in range(1, len(times)):
        x[k] = x[k - 1] + (times[k] - times[k - 1]) * (drive_[k - 1] - x[k - 1])
    return {"x": x}


def lag_problem(
    formula: str = "G[0,10] (x <= 0.9)",
    *,
    inputs: int = 1,
    limit: float = 1.0,
    points: int = 4,
    free: Freedom | None = None,
    parameters: Sequence[ParameterRange] = (),
    response: Response = lag,
    name: str = "LAG",
) -> Problem:
    """Problem with a first-order lag over ten seconds: output ``x``, up to three inputs ``u``, ``v``, ``w``.

    With the defaults it is violated only if ``u`` stays near its upper bound for a long time.

    Args:
        formula: the requirement over x and the inputs.
        inputs: number of inputs, 0 to 3.
        limit: the inputs' range is [-limit, limit].
        points: number of control points of each input, linearly interpolated.
        free: limits of a free parameterization of the inputs; None for a fixed one.
        parameters: the searched ones of ``x0``, ``bias`` and ``gain``, for example ``[START, BIAS]``.
        response: the function that is simulated.
        name: name of the requirement.
    """
    drives = tuple(
        InputRange(
            input_,
            -limit,
            limit,
            control_points=points,
            interpolation="linear",
            free=free,
            unit="V",
            description="drive",
        )
        for input_ in "uvw"[:inputs]
    )
    variables = (
        *(_input(r) for r in drives),
        Variable("x", causality="output", unit="m", description="position"),
        Variable("gain", causality="parameter", start=1.0, settable=True),
        Variable("bias", causality="parameter", start=0.0, settable=True),
        Variable("x0", causality="parameter", start=0.0, settable=True),
    )
    return Problem(
        FunctionModel(response, ModelInfo("lag", "A first-order lag.", variables=variables)),
        Requirement(name, formula),
        SearchSpace(drives, tuple(parameters), STOP_TIME),
        Experiment(STOP_TIME, INTERVAL, ("x",)),
    )


def _input(r: InputRange) -> Variable:
    return Variable(
        r.name, causality="input", unit=r.unit, low=r.low, high=r.high, start=0.0, description=r.description
    )


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
            lag_problem(parameters=[START]),
            lag_problem(free=FREE, parameters=[START]),
            lag_problem(inputs=0, parameters=[START, BIAS]),
            lag_problem(inputs=2, free=FREE),
        )

    def test_candidates_are_admitted_by_the_space(self) -> None:
        """Candidates are within their ranges and allowed parameterizations, with origin and rationale."""
        for problem in self.problems():
            engine = self.make(problem, seed=1)
            for candidate in drive(engine, partial(evaluate, problem), rounds=self.rounds):
                assert problem.space.admit(candidate).key == candidate.key
                assert candidate.origin and candidate.rationale

    def test_deterministic_for_a_seed(self) -> None:
        """The same seed and calls give the same candidates; another seed gives others."""
        for problem in self.problems():
            judge = partial(evaluate, problem)
            runs = [drive(self.make(problem, seed), judge, rounds=self.rounds) for seed in (3, 3, 4)]
            keys = [[c.key for c in run] for run in runs]
            assert keys[0] == keys[1]
            assert keys[0] != keys[2]

    def test_asks_for_as_many_as_wanted(self) -> None:
        """``ask(n)`` returns n candidates, even if nothing has been told since the last call."""
        problem = lag_problem(free=FREE, parameters=[START])
        engine = self.make(problem, seed=5)
        assert len(drive(engine, partial(evaluate, problem), rounds=3, n=4)) == 3 * 4
        assert len(engine.ask(3)) == 3
        assert len(engine.ask(2)) == 2

    def test_accepts_foreign_evaluations(self) -> None:
        """``tell`` accepts candidates that the engine did not propose, with other control points."""
        problem = lag_problem(free=FREE, parameters=[START])
        judge = partial(evaluate, problem)
        foreign = [
            Candidate(
                {"u": Signal((0.0, 2.5, 7.0), (0.5, -1.0, 0.25), "constant")}, {"x0": 0.25}, "somebody"
            ),
            Candidate({"u": Signal((0.0,), (1.0,), "pchip")}, {"x0": 1.0}, "somebody"),
        ]
        engine = self.make(problem, seed=6)
        engine.tell([judge(problem.space.admit(c)) for c in foreign])
        assert len(drive(engine, judge, rounds=self.rounds)) == self.rounds

    def test_survives_failures(self) -> None:
        """The engine continues after evaluations without verdict or trajectory."""
        problem = lag_problem(parameters=[START])
        diverging = partial(Evaluation, status="failed", reason="diverged")
        judges = cycle((partial(evaluate, problem), diverging))
        for failing in (lambda c: next(judges)(c), partial(Evaluation, status="timeout", reason="too slow")):
            assert len(drive(self.make(problem, seed=7), failing, rounds=self.rounds)) == self.rounds

    def test_survives_a_plateau(self) -> None:
        """If every candidate has the same robustness, the engine does not repeat one candidate."""
        problem = lag_problem(parameters=[START])
        level = Verdict(0.5, critical_time=0.0, predicate="x <= 0.9")
        asked = drive(
            self.make(problem, seed=8),
            lambda candidate: replace(evaluate(problem, candidate), verdict=level),
            rounds=self.rounds,
        )
        assert len({c.key for c in asked}) > self.rounds / 2

    def test_resumes_by_replay(self) -> None:
        """After the same calls, a new instance continues with the same candidates."""
        problem = lag_problem(free=FREE, parameters=[START])
        judge = partial(evaluate, problem)
        first, second = self.make(problem, seed=9), self.make(problem, seed=9)
        drive(first, judge, rounds=self.rounds, n=2)
        drive(second, judge, rounds=self.rounds, n=2)
        assert [c.key for c in first.ask(2)] == [c.key for c in second.ask(2)]
