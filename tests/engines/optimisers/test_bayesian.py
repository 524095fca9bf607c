"""Gaussian processes in a trust region."""

from functools import partial

import numpy as np
import pytest

from bench.example_systems import Array, function_problem
from falsifier.core.candidate import Candidate
from falsifier.core.model import Kind
from falsifier.core.ranges import ParameterRange
from falsifier.engines.optimisers.bayesian import Bayesian
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.testing import drive, lag
from tests.engines.support import flat


def parameters_problem(kind: str, count: int) -> Problem:
    ranges = tuple(
        ParameterRange(
            f"p{i}", 0, 20, kind="integer" if kind == "integer" or (kind == "mixed" and i % 2) else "real"
        )
        for i in range(count)
    )
    return function_problem(lag, "G (x <= 1)", (), ranges, {"x": "real"}, 1.0, 0.1)


@pytest.mark.parametrize("kind", ["real", "integer", "mixed"])
def test_the_trust_region_finds_the_bottom_of_a_bowl_in_few_simulations(kind: str) -> None:
    problem = parameters_problem(kind, 6)
    target = np.array([3.0, 17.0, 8.0, 20.0, 0.0, 11.0])

    def judge(candidate: Candidate) -> Evaluation:
        distance = float(np.abs(problem.space.encode(candidate) - target).sum())
        return Evaluation(candidate, verdict=Verdict(distance, 0.0, "bowl"))

    found = [judge(c).robustness for c in drive(Bayesian(problem, seed=0), judge, rounds=70)]
    assert min(d for d in found if d is not None) <= 6.0, "uniform points come within about 22"


def test_two_conditions_of_different_size_are_met_at_once() -> None:
    ranges = tuple(ParameterRange(f"p{i}", 0, 1) for i in range(8))

    def model(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
        p = np.array([parameters[r.name] for r in ranges])
        near, far = 1e-4 * float(np.sum((p - 0.3) ** 2)), 1e4 * float(np.sum((p[:4] - 0.6) ** 2))
        return {"near": np.full(len(times), near), "far": np.full(len(times), far)}

    # Of 250,000 uniform points, one violates it.
    formula, outputs = "G (near >= 0.12e-4) or G (far >= 0.12e4)", dict[str, Kind](near="real", far="real")
    problem = function_problem(model, formula, (), ranges, outputs, 1.0, 0.1)
    judged = partial(evaluate, problem)
    for seed in range(3):
        asked = drive(Bayesian(problem, seed=seed), judged, rounds=50)
        assert any(judged(candidate).violated for candidate in asked), "of the robustness alone, 54 and more"


def test_the_trust_region_starts_again_where_nothing_improves() -> None:
    asked = drive(Bayesian(parameters_problem("real", 2), seed=0), flat, rounds=60)
    starts = [i for i, c in enumerate(asked) if c.rationale.startswith("a new start")]
    assert max(starts) > 20 and len(starts) < 30
