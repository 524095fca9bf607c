from collections.abc import Mapping

import numpy as np
import pytest

from falsifier.errors import SimulationError, SpecError
from falsifier.search.assurance import assess
from falsifier.search.assurance.bounds import interval, upper_bound
from falsifier.search.run import falsify
from falsifier.testing import BIAS, Array, lag_problem
from tests.problems import mostly_broken, never


def direct(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    """Give the parameter itself, so that the probability of a violation is that of a uniform number."""
    return {"x": np.full(times.shape, parameters["bias"])}


def system(limit: float):  # type: ignore[no-untyped-def]
    return lag_problem(f"G[0,10] (x <= {limit})", inputs=0, parameters=[BIAS], response=direct)


def test_violations_are_those_of_the_uniform_engine_with_exact_bounds() -> None:
    problem = system(0.8)
    found = assess(problem, budget=60, seed=3)
    same = falsify(system(5.0), "uniform", budget=60, seed=3).evaluations
    expected = sum(e.candidate.parameters["bias"] > 0.8 for e in same)
    assert (found.drawn, found.violations) == (60, expected) and expected > 0
    assert found.bound == upper_bound(expected, 60, 0.95)
    assert found.interval == interval(expected, 60, 0.95)
    assert found.smallest.robustness == pytest.approx(0.8 - max(e.candidate.parameters["bias"] for e in same))


def test_without_violations_the_bound_and_the_nearest_miss_are_said() -> None:
    found = assess(system(2.0), budget=100, confidence=0.99)
    assert found.interval is None and found.splitting is None
    assert found.bound == pytest.approx(1 - 0.01 ** (1 / 100))
    for part in (
        "0 of 100 random simulations violate",
        "With 99 % confidence, the probability of a violation is at most 0.045",
        "smallest robustness of these was +1.0",
        "bias uniform in [-1, 1]",
    ):
        assert part in found.text


def test_splitting_takes_its_part_of_the_budget_and_is_marked_as_an_estimate() -> None:
    counts: list[int] = []
    found = assess(system(0.998), budget=3800, splitting=3750, seed=1, progress=counts.append)
    assert found.drawn == 50 and found.splitting is not None
    assert counts[-1] == 50 + found.splitting.simulations <= 3800
    assert found.splitting.low <= 1e-3 <= found.splitting.high
    assert "Estimate, not a bound" in found.text


def test_a_condition_that_never_held_makes_the_bound_say_little() -> None:
    problem = lag_problem(
        "G[0,10] (x >= 5 -> x <= 0)", inputs=0, parameters=[BIAS], response=direct, name="VACUOUS"
    )
    found = assess(problem, budget=30, seed=1)
    run = falsify(problem, "uniform", budget=30, seed=1)
    assert found.findings == run.findings
    assert [finding.kind for finding in found.findings] == ["condition"]
    for part in (
        "the probability of a violation is at most 0.095",
        "a part of the requirement was not tested",
        "The condition x >= 5 never held in 30 simulations",
        "x reached 0.9",
    ):
        assert part in found.text


def test_a_requirement_that_nothing_moves_is_told() -> None:
    still = lag_problem(
        inputs=0, parameters=[BIAS], response=lambda times, *_: {"x": np.zeros_like(times)}, name="STILL"
    )
    found = assess(still, budget=30)
    assert "Nothing that was searched had an effect on x" in found.text
    assert not assess(system(0.8), budget=30).findings


def test_failed_simulations_are_never_to_the_system_s_credit() -> None:
    found = assess(lag_problem("G[0,10] (x <= 3)", response=mostly_broken), budget=50, seed=1)
    assert found.violations == 0 and found.failures > 25
    assert found.bound == upper_bound(found.failures, 50, 0.95)
    assert "the bound counts them as violations" in found.text
    with pytest.raises(SimulationError, match="out of order"):
        assess(lag_problem(response=never), budget=3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"budget": 0}, "budget"),
        ({"budget": 10, "confidence": 95}, "between 0 and 1"),
        ({"budget": 10, "splitting": 10}, "fewer simulations than the budget"),
        ({"budget": 1000, "splitting": 20}, "expected 0, or at least"),
    ],
)
def test_numbers_out_of_range_are_refused(options: dict[str, float], said: str) -> None:
    with pytest.raises(SpecError, match=said):
        assess(system(0.5), **options)  # type: ignore[arg-type]


def test_a_problem_with_nothing_to_vary_is_refused() -> None:
    with pytest.raises(SpecError, match="nothing to vary"):
        assess(lag_problem(inputs=0), budget=5)


def test_what_was_drawn_when_the_user_stopped_counts() -> None:
    def stop(count: int) -> None:
        if count == 7:
            raise KeyboardInterrupt

    found = assess(system(5.0), budget=50, progress=stop)
    # The simulation that was just counted is lost; nothing else is.
    assert (found.drawn, found.interrupted) == (6, True)
    assert found.bound == upper_bound(0, 6, 0.95)
    assert "Stopped by the user" in found.text
    with pytest.raises(KeyboardInterrupt):
        assess(system(5.0), budget=50, progress=lambda count: stop(7))


def test_what_a_search_found_is_stated_beside_the_bound() -> None:
    found = assess(system(5.0), budget=10, optimum=0.25)
    assert "A search, which came nearer, found +0.25." in found.text
    assert (
        "A search found a violation, with robustness -0.5."
        in assess(system(5.0), budget=5, optimum=-0.5).text
    )


def test_a_tail_is_estimated_from_enough_draws() -> None:
    assert assess(system(5.0), budget=20).tail is None
    found = assess(system(1.001), budget=200)
    assert found.tail is not None and found.tail.points == 20
    assert "xtreme value theory" in found.text
