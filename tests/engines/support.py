"""What engines are tested on: the contract by name, and a bowl over the box of a small problem."""

from dataclasses import replace
from functools import partial

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.engines.surrogate import Settings
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.testing import FREE, START, drive, lag_problem

# Neither the contract nor who proposes when depends on how thorough a plan is.
HASTY = Settings(cells=20, pool=40, generations=1, bound_steps=1, trial=2)
TARGET = np.array([0.6, -0.2, 0.15, -0.75, 0.35])


def box_problem() -> Problem:
    """Five coordinates: four control points and a parameter."""
    return lag_problem(parameters=[START])


def wide_problem(formula: str = "G[0,10] (x <= 9)", *, inputs: int = 1) -> Problem:
    """Free inputs in [-2, 2] that cannot violate: x follows them with a lag of 1 s."""
    return lag_problem(formula, limit=2.0, free=FREE, inputs=inputs)


def level(problem: Problem, candidate: Candidate, robustness: float = 0.5) -> Evaluation:
    """A simulation that is judged by another margin than its trajectory shows."""
    return replace(evaluate(problem, candidate), verdict=Verdict(robustness, 0.0, "x <= 9"))


def bowl(problem: Problem, candidate: Candidate) -> Evaluation:
    """Judge by the distance from a point of the box; the least robustness is 1."""
    distance = problem.space.encode(candidate) - TARGET
    return Evaluation(candidate, verdict=Verdict(1.0 + 4.0 * float(distance @ distance), 0.0, "bowl"))


def flat(candidate: Candidate) -> Evaluation:
    """Judge all the same."""
    return Evaluation(candidate, verdict=Verdict(1.0, 0.0, "flat"))


def doubtful(problem: Problem, evaluation: Evaluation) -> Confirmation:
    """A violation of robustness -1 that does not count, because it is fragile."""
    return Confirmation(
        problem=problem, evaluation=evaluation, outcome="fragile", robustness=-1.0, reference=-1.0, reason=""
    )


def best_of(name: str, *, simulations: int) -> float:
    """Least robustness that an engine finds in the bowl."""
    judge = partial(bowl, box_problem())
    asked = drive(make_engine(name, box_problem(), seed=1), judge, rounds=simulations)
    return min(judge(candidate).robustness or 0.0 for candidate in asked)
