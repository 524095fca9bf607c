from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import binom

from falsifier.analyses.assess import Draws, Searched, assess, lower_bound, upper_bound
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.errors import SimulationError, SpecError
from falsifier.evaluation.evaluate import evaluate
from falsifier.record.run import falsify
from falsifier.testing import BIAS, FREE, START, Array, lag_problem
from tests.engines.support import doubtful
from tests.problems import decades, mostly_broken, never, straight


def system(limit: float):  # type: ignore[no-untyped-def]
    return lag_problem(f"G[0,10] (x <= {limit})", inputs=0, parameters=[BIAS], response=straight)


def test_violations_are_those_of_draws_that_no_search_with_this_seed_made_with_exact_bounds() -> None:
    found = assess(system(0.8), budget=60, seed=3)
    drawn = [candidate.parameters["bias"] for candidate in Draws(system(0.8), seed=3).ask(60)]
    for engine in ("uniform", "corners"):
        searched = falsify(system(5.0), engine, budget=60, seed=3).evaluations
        assert not {e.candidate.parameters["bias"] for e in searched} & set(drawn), engine
    expected = sum(bias > 0.8 for bias in drawn)
    assert (found.drawn, found.violations) == (60, expected) and expected > 0
    assert found.bound == upper_bound(expected, 60, 0.95)
    assert found.interval == (lower_bound(expected, 60, 0.975), upper_bound(expected, 60, 0.975))
    always = replace(found, bound=0.99441, interval=(0.99959, 1.0)).text
    assert "is at most 0.995." in always and "between 0.999 and 1." in always, "rounded, and still bounds"
    assert found.best.robustness == pytest.approx(0.8 - max(drawn))


def test_without_violations_the_bound_and_the_nearest_miss_are_said() -> None:
    found = assess(system(2.0), budget=100, confidence=0.99)
    assert found.interval == (0.0, upper_bound(0, 100, 0.995))
    assert "between" not in found.text
    assert found.bound == pytest.approx(1 - 0.01 ** (1 / 100))
    for part in (
        "Violations: 0 of 100 random simulations.",
        "With 99 % confidence (one-sided), the probability of a violation is at most 0.045",
        "smallest robustness of these was +1.0",
        "bias uniform in [-1, 1]",
    ):
        assert part in found.text


def test_a_condition_that_never_held_makes_the_bound_say_little() -> None:
    problem = lag_problem(
        "G[0,10] (x >= 5 -> x <= 0)", inputs=0, parameters=[BIAS], response=straight, name="VACUOUS"
    )
    found = assess(problem, budget=30, seed=1)
    assert [finding.kind for finding in found.findings] == ["condition"]
    for part in (
        "the probability of a violation is at most 0.095",
        "a part of the requirement was not tested",
        "The condition x >= 5 never held in 30 simulations",
        "x reached 0.9",
    ):
        assert part in found.text


def test_failed_simulations_are_never_to_the_system_s_credit() -> None:
    found = assess(lag_problem("G[0,10] (x <= 3)", response=mostly_broken), budget=50, seed=1)
    failed = sum(failure.count for failure in found.failures)
    assert found.violations == 0 and failed > 25
    assert found.bound == upper_bound(failed, 50, 0.95)
    assert f"{failed} simulations failed, for example simulation " in found.text
    assert "The bound counts failed simulations as violations" in found.text
    with pytest.raises(SimulationError, match="out of order"):
        assess(lag_problem(response=never), budget=3)


def test_numbers_out_of_range_and_a_problem_with_nothing_to_vary_are_refused() -> None:
    with pytest.raises(SpecError, match="budget"):
        assess(system(0.5), budget=0)
    with pytest.raises(SpecError, match="between 0 and 1"):
        assess(system(0.5), budget=10, confidence=95)
    with pytest.raises(SpecError, match="nothing to vary"):
        assess(lag_problem(inputs=0), budget=5)


def interrupting(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Be stopped by the user in the first simulation."""
    raise KeyboardInterrupt


def test_what_was_drawn_when_the_user_stopped_counts() -> None:
    def stop(count: int) -> None:
        if count == 7:
            raise KeyboardInterrupt

    found = assess(system(5.0), budget=50, progress=stop)
    assert (found.drawn, found.interrupted) == (7, True)
    assert found.bound == upper_bound(0, 7, 0.95)
    assert "Stopped by the user" in found.text
    with pytest.raises(KeyboardInterrupt):
        assess(lag_problem(response=interrupting), budget=50)


def test_what_a_search_found_is_stated_beside_the_bound_and_no_violation_is_of_probability_zero() -> None:
    searched = falsify(system(5.0), "corners", budget=4).evaluations
    found = assess(system(5.0), budget=10, searched=searched)
    assert found.searched is not None
    assert (found.searched.violation, found.searched.smallest_robustness) == (None, 4.0)
    assert "A search of 4 simulations came nearer: its smallest robustness was +4" in found.text
    searched = falsify(system(0.9999), "corners", budget=10).evaluations
    found = assess(system(0.9999), budget=100, searched=searched)
    assert found.violations == 0
    assert found.searched == Searched(1, searched[-1].robustness, 1)
    assert "The search found a violation in 1 simulation, although no draw violates." in found.text
    doubts = [doubtful(found.problem, searched[-1])]
    found = assess(found.problem, budget=5, searched=searched, doubtful=doubts)
    assert found.searched == Searched(1, searched[-1].robustness, unconfirmed=1)


def test_a_violation_with_signals_that_are_not_drawn_says_nothing_of_the_draws() -> None:
    problem = lag_problem(free=FREE)
    edge = evaluate(problem, Candidate({"u": Signal((0.0, 0.1), (0.9, 1.0))}))
    full = evaluate(problem, Candidate({"u": Signal((0.0,), (1.0,), "constant")}))
    assert edge.violated and full.violated
    found = assess(problem, budget=5, searched=[edge])
    assert "control points that are not drawn here: the bound says nothing about it." in found.text
    # However a constant input is written, it is one of those that are drawn.
    assert assess(problem, budget=5, searched=[full]).searched == Searched(1, full.robustness, 1)


def test_what_a_probability_is_of_is_said() -> None:
    problem = lag_problem(points=5, parameters=[START], free=FREE)
    text = assess(problem, budget=3).text
    for part in (
        "inputs drawn uniformly from the search space with this parameterization",
        "not for inputs in operation",
        "u with 5 control points 2.5 s apart, linear, each uniform in [-1, 1] V",
        "x0 uniform in [-1, 1]",
        "other control points, which a search may try, are not drawn",
    ):
        assert part in text
    assert "bias log-uniform in [1e-07, 1]" in assess(decades(), budget=1).text
    gear = InputRange("u", 1, 4, kind="integer", interpolation="constant")
    held = InputRange("v", 0, 1, control_points=3, hold=0.5, interpolation="pchip")
    problem = replace(lag_problem(inputs=2, limit=4), space=SearchSpace((gear, held), (), 10.0))
    text = assess(problem, budget=3).text
    assert "u constant, uniform in [1, 4], each allowed number equally likely" in text
    assert "v with 3 control points 5 s apart, pchip, held for 0.5 s" in text and "not drawn" not in text


def test_each_allowed_number_is_equally_likely() -> None:
    gear = InputRange("u", 1, 4, kind="integer", interpolation="constant")
    mode = ParameterRange("x0", 1, 5, kind="enumeration", items=(("hold", 5), ("down", 1), ("up", 2)))
    drawn = Draws(replace(lag_problem(), space=SearchSpace((gear,), (mode,), 10.0)), seed=0).ask(1200)
    numbers = Counter((c.signals["u"].values[0], c.parameters["x0"]) for c in drawn)
    assert numbers.keys() == set(product((1, 2, 3, 4), (1, 2, 5))) and min(numbers.values()) > 70


def test_a_range_in_decades_is_drawn_evenly_in_them() -> None:
    drawn = Draws(decades(), seed=0).ask(1000)
    assert 450 < sum(c.parameters["bias"] < 10**-3.5 for c in drawn) < 550


def test_at_a_bound_so_few_or_so_many_are_just_as_improbable_as_stated() -> None:
    for happened, trials in ((0, 10), (3, 100), (99, 100)):
        assert binom.cdf(happened, trials, upper_bound(happened, trials, 0.95)) == pytest.approx(0.05)
    assert binom.sf(3 - 1, 100, lower_bound(3, 100, 0.9)) == pytest.approx(0.1)
    assert upper_bound(0, 1000, 0.95) == pytest.approx(3 / 1000, rel=5e-3)
    assert (lower_bound(0, 1000, 0.95), upper_bound(7, 7, 0.95)) == (0.0, 1.0)


@pytest.mark.parametrize("probability", [1e-4, 1e-2, 0.3])
def test_bounds_hold_at_least_as_often_as_stated(probability: float) -> None:
    """Exactly, over all outcomes, with the probability of each."""
    trials = 300
    outcomes = range(trials + 1)
    weights = binom.pmf(np.arange(trials + 1), trials, probability)
    above = [upper_bound(k, trials, 0.95) >= probability for k in outcomes]
    within = [lower_bound(k, trials, 0.975) <= probability <= upper_bound(k, trials, 0.975) for k in outcomes]
    assert weights[above].sum() >= 0.95
    assert weights[within].sum() >= 0.95
