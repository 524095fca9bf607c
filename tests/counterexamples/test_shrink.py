import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Freedom, ParameterRange
from falsifier.core.signals import Signal
from falsifier.counterexamples.shrink import PASSES, Shrunk, shrink
from falsifier.counterexamples.simplicity import simplicity
from falsifier.errors import SpecError
from falsifier.evaluation.confirm import half_step
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.testing import INTERVAL, Array, lag_problem
from tests.stepped import euler_problem

FREE = Freedom(max_control_points=20, min_interval=0.1)


def ramp(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Integrator of the input, from x0."""
    x0 = parameters.get("x0", 0.0)
    return {"x": x0 + np.concatenate(([0.0], np.cumsum(inputs["u"][:-1]) * INTERVAL))}


def violation(problem: Problem, seed: int = 0) -> Evaluation:
    """First violation among uniform samples."""
    rng = np.random.default_rng(seed)
    low, high = problem.space.bounds.T
    for _ in range(500):
        found = evaluate(problem, problem.space.decode(rng.uniform(low, high)))
        if found.violated:
            return found
    raise AssertionError("no violation among 500 samples")


def assert_local_minimum(problem: Problem, shrunk: Shrunk) -> None:
    """No pass has a simpler candidate that violates, at half the step too."""
    limit = simplicity(problem, shrunk.evaluation.candidate)
    for propose in PASSES:
        for proposal in propose(problem, shrunk.evaluation.candidate):
            candidate = problem.space.admit(proposal)
            if simplicity(problem, candidate) < limit:
                robustness = evaluate(problem, candidate).robustness
                violated = robustness is not None and robustness < 0 and robustness <= shrunk.at_most
                assert not (violated and evaluate(half_step(problem), candidate).violated), propose.__name__


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("free", [None, FREE])
def test_the_result_is_a_violating_local_minimum(seed: int, free: Freedom | None) -> None:
    x0 = ParameterRange("x0", -1.0, 1.0, nominal=0.0)
    problem = lag_problem(
        "G[0,10] (x <= 2)  or F[0,10] (x < -1.5)", response=ramp, free=free, parameters=(x0,)
    )
    shrunk = shrink(problem, violation(problem, seed), budget=2000)
    assert shrunk.minimal
    assert shrunk.evaluation.violated
    assert simplicity(problem, shrunk.evaluation.candidate) < simplicity(problem, shrunk.original.candidate)
    assert problem.space.admit(shrunk.evaluation.candidate).key == shrunk.evaluation.candidate.key
    assert_local_minimum(problem, shrunk)


def test_what_does_not_matter_comes_to_rest_and_what_does_becomes_round() -> None:
    x0 = ParameterRange("x0", -1.0, 1.0, nominal=0.25)
    problem = lag_problem("G[0,10] (x <= 5.1)", response=ramp, free=FREE, parameters=(x0,))
    signal = Signal((0.0, 3.3, 7.1, 9.0), (0.81, 0.72, 0.93, 0.64), "pchip")
    original = evaluate(problem, problem.space.admit(Candidate({"u": signal}, {"x0": 0.777})))
    shrunk = shrink(problem, original)
    assert shrunk.original is original
    assert shrunk.evaluation.candidate.signals["u"] == Signal((0.0,), (1.0,), "constant")
    assert shrunk.evaluation.candidate.parameters == {"x0": 0.25}
    assert shrunk.evaluation.candidate.origin == "shrink"


def test_a_change_that_is_needed_stays() -> None:
    problem = lag_problem("(F[0,4] (x >= 2)) -> (G[4,10] (x >= 1))", response=ramp, free=FREE)
    signal = Signal((0.0, 3.1, 5.2, 8.8), (0.9, 0.95, -0.7, -0.9), "linear")
    original = evaluate(problem, Candidate({"u": signal}, {}))
    assert original.violated
    shrunk = shrink(problem, original, budget=3000)
    found = shrunk.evaluation.candidate.signals["u"]
    assert shrunk.minimal
    assert found.switches == 1
    assert len(found.times) == 2
    assert set(found.values) == {1.0, -1.0}
    assert_local_minimum(problem, shrunk)


def test_shrinking_is_deterministic_and_keeps_its_budget() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=ramp)
    original = violation(problem)
    first, second = shrink(problem, original), shrink(problem, original)
    assert first.evaluation.candidate.key == second.evaluation.candidate.key
    assert first.simulations == second.simulations
    for budget in (1, 2, 3, 5):
        short = shrink(problem, original, budget=budget)
        assert short.simulations <= budget
        assert short.evaluation.violated
        assert not short.minimal


def test_what_is_minimal_already_is_returned_as_it_was() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=ramp)
    once = shrink(problem, violation(problem)).evaluation
    again = shrink(problem, once)
    assert again.minimal
    assert again.evaluation is once


def test_a_demanded_margin_is_kept() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", response=ramp)
    original = evaluate(problem, problem.space.decode([0.9, 0.8, 0.95, 0.9]))
    shrunk = shrink(problem, original, at_most=-5.0)
    assert shrunk.evaluation.robustness is not None
    assert shrunk.evaluation.robustness <= -5.0
    with pytest.raises(SpecError, match="more than -9"):
        shrink(problem, original, at_most=-9.0)
    assert original.robustness is not None
    close = original.robustness - 1e-9
    with pytest.raises(SpecError) as refused:
        shrink(problem, original, at_most=close)
    shown = re.findall(r"[-+]\d[\d.]+\d", str(refused.value))
    assert len(set(shown)) == 2, "numbers that differ are told apart"


def test_numbers_of_numpy_are_rounded_too() -> None:
    problem = lag_problem("G[10,10] (not (x > 0.6 and x < 0.65))", free=FREE)
    times, values = np.array([0.0, 5.0]), np.array([0.5123, 0.6321])
    original = evaluate(problem, Candidate({"u": Signal(tuple(times), tuple(values), "constant")}))
    assert shrink(problem, original).minimal


def test_half_of_the_margin_is_kept_unless_another_one_is_demanded() -> None:
    problem = lag_problem("G[10,10] (x <= 2 or x >= 9)", response=ramp)
    signal = problem.space.decode([0.5] * 4).signals["u"]
    drive = replace(signal, values=(0.23, 0.55, 0.6, 0.23))
    original = evaluate(problem, Candidate({"u": drive}))
    assert original.robustness is not None
    kept, weak = shrink(problem, original), shrink(problem, original, at_most=0.0)
    assert kept.at_most == 0.5 * original.robustness
    assert weak.at_most == 0.0
    assert kept.evaluation.robustness is not None and weak.evaluation.robustness is not None
    assert kept.evaluation.robustness <= 0.5 * original.robustness < weak.evaluation.robustness < 0


def test_shrinking_does_not_end_at_a_fragile_one() -> None:
    # x(1) of a constant u is 0.6513 u with 0.1 s and 0.6415 u with 0.05 s: at 0.5 only the former violates.
    problem = euler_problem("G[1,1] (x <= 0.323 or u >= 0.6)")
    original = evaluate(problem, problem.space.decode([0.52, 0.53, 0.4, 0.52]))
    rounded = evaluate(problem, problem.space.decode([0.5] * 4))
    assert rounded.violated
    assert not evaluate(half_step(problem), rounded.candidate).violated
    shrunk = shrink(problem, original)
    assert shrunk.minimal
    assert shrunk.evaluation.candidate.signals["u"].values == (0.52,) * 4


def test_at6a_shrinks_to_one_change_of_throttle_without_brake() -> None:
    problem = load_problem("AT6a")
    signals = {
        "throttle": Signal((0.0, 3.4575, 6.2728), (44.82, 53.369, 17.89), "linear"),
        "brake": Signal((0.0, 20.0), (1.7146, 32.187), "pchip"),
    }
    original = evaluate(problem, problem.space.admit(Candidate(signals)))
    shrunk = shrink(problem, original, at_most=0.0)
    found = shrunk.evaluation.candidate.signals
    assert shrunk.minimal
    assert found["brake"].values == (0.0,)
    assert found["throttle"].interpolation == "constant"
    assert found["throttle"].switches == 1
    assert_local_minimum(problem, shrunk)


def test_a_near_miss_becomes_simple_and_stays_as_near() -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    start = evaluate(problem, problem.space.decode([0.91, 0.97, 1.0, 0.99]))
    assert start.robustness is not None
    found = shrink(problem, start)
    assert found.minimal
    assert found.evaluation.candidate.signals["u"].values == (1.0,) * 4
    near = shrink(problem, start, at_most=start.robustness)
    assert near.evaluation.robustness is not None
    assert near.evaluation.robustness <= start.robustness


def test_a_near_miss_may_become_a_violation() -> None:
    problem = lag_problem("G[0,10] (x <= 0.99)")
    start = evaluate(problem, problem.space.decode([0.95, 0.95, 0.95, 0.97]))
    assert not start.violated
    assert shrink(problem, start).evaluation.violated
    with pytest.raises(SpecError, match="more than -1"):
        shrink(problem, start, at_most=-1.0)


@pytest.mark.parametrize("wrong", [{"budget": 0}, {"at_most": float("nan")}, {"at_most": 1.0}])
def test_numbers_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    problem = lag_problem()
    violating = evaluate(problem, problem.space.decode([1.0] * 4))
    (name,) = wrong
    with pytest.raises(SpecError, match=f"{name}: .*expected"):
        shrink(problem, violating, **wrong)  # type: ignore[arg-type]
