"""The chasing cars as five FMUs against the same cars as one: what differs is what the coupling costs."""

from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.evaluation.evaluate import evaluate, judge
from falsifier.fmu import FmuModel, System
from falsifier.problem.loading import load_problems
from falsifier.problem.problem import Problem, alike

CARS = range(1, 6)


def problems(system: str) -> list[Problem]:
    """The problems of a system in this process, which all record the same signals."""
    found = []
    for problem in load_problems(system):
        assert isinstance(problem.model, FmuModel | System)
        found.append(replace(problem, model=replace(problem.model, isolate=False)))
    (group,) = alike(found)
    return group


MONOLITHIC, COUPLED = problems("CC"), problems("CCcars")
SPACE = MONOLITHIC[0].space.fixed


def candidates(number: int) -> list[Candidate]:
    low, high = SPACE.bounds.T
    rng = np.random.default_rng(3)
    return [SPACE.decode(rng.uniform(low, high)) for _ in range(number)]


def as_cars(candidate: Candidate) -> Candidate:
    return Candidate({f"car1.{name}": signal for name, signal in candidate.signals.items()}, {})


def distances(candidate: Candidate, step: float) -> list[float]:
    """Largest distance in m between the two simulations, by car, both with this communication step."""
    found = []
    for problem, tried in ((MONOLITHIC[0], candidate), (COUPLED[0], as_cars(candidate))):
        experiment = replace(problem.experiment, step_size=step)
        found.append(evaluate(replace(problem, experiment=experiment), tried).trajectory)
    one, five = found
    assert one is not None and five is not None
    return [float(np.abs(one[f"y{k}"] - five[f"car{k}.y"]).max()) for k in CARS]


def test_the_difference_is_proportional_to_the_communication_step() -> None:
    """A car sees the one ahead at communication points, so it changes its mode up to one step late."""
    coarse = np.median([distances(c, 0.01) for c in candidates(6)], axis=0)
    fine = np.median([distances(c, 0.0025) for c in candidates(6)], axis=0)
    assert coarse[0] < 1e-9 and fine[0] < 1e-9, "nobody is ahead of the leader"
    assert (coarse[1:] < 1.0).all(), "one step at some 50 m/s per change of mode"
    assert coarse[1:] / fine[1:] == pytest.approx(4.0, rel=0.6)


def test_each_requirement_is_violated_by_the_same_inputs() -> None:
    corners = [SPACE.decode(np.repeat(values, 10).astype(float)) for values in ([1, 0], [0, 1], [1, 1])]
    violated = set()
    for candidate in [*candidates(5), *corners]:
        one, five = evaluate(MONOLITHIC[0], candidate), evaluate(COUPLED[0], as_cars(candidate))
        for a, b in zip(MONOLITHIC, COUPLED, strict=True):
            first, second = judge(a, one).robustness, judge(b, five).robustness
            assert first is not None and second is not None
            assert first * second > 0 or abs(first - second) < 0.1, a.name
            violated |= {a.name} if first < -0.1 and second < -0.1 else set()
    assert violated >= {"CC1", "CC2", "CC3"}
