import pytest

from falsifier.analyses.margin import margin
from falsifier.errors import SimulationError, SpecError
from falsifier.problem.problem import Problem
from falsifier.testing import BIAS, lag_problem
from tests.problems import never, straight


def system() -> Problem:
    return lag_problem(inputs=0, parameters=[BIAS], response=straight)


@pytest.mark.parametrize(
    ("vary", "hardest"), [("G[0,10] (x <= {limit})", 1.0), ("G[0,10] (x >= {limit})", -1.0)]
)
def test_the_threshold_is_found_between_two_values_in_either_direction(vary: str, hardest: float) -> None:
    found = margin(system(), vary, (-3, 3), engine="corners", budget=60)
    assert found.falsified is not None and found.unfalsified is not None
    assert min(found.falsified, found.unfalsified) <= hardest <= max(found.falsified, found.unfalsified)
    assert abs(found.unfalsified - found.falsified) <= 0.06 and found.complete
    assert found.simulations <= 60
    assert "falsified at" in found.text


def test_ends_of_the_range_are_said_to_be_so() -> None:
    always = margin(system(), "G[0,10] (x <= {limit})", (-0.9, 0.5), engine="corners", budget=40)
    assert (always.falsified, always.unfalsified) == (0.5, None)
    assert "in the whole range, even at 0.5" in always.text
    nothing = margin(system(), "G[0,10] (x <= {limit})", (1.5, 3), engine="corners", budget=40)
    assert (nothing.falsified, nothing.unfalsified) == (None, 1.5)
    assert "not even at 1.5" in nothing.text


def test_what_is_simulated_already_is_judged_for_other_thresholds() -> None:
    """One search in vain at the end finds the threshold: no simulation is needed below what was reached."""
    found = margin(system(), "G[0,10] (x <= {limit})", (-3, 3), engine="corners", budget=60)
    assert found.searches[0] == (3, False)
    assert all(threshold > 0.9 for threshold, _ in found.searches)


@pytest.mark.parametrize(
    ("vary", "between", "said"),
    [
        ("G[0,10] (x <= 1)", (0, 1), "in place of the threshold"),
        ("G[0,10] (x <= {limit})", (1, 0), "LOW < HIGH"),
        ("G[0,10] (x <= {limit} - {limit})", (0, 1), "robustness is the same"),
    ],
)
def test_wrong_questions_are_refused(vary: str, between: tuple[float, float], said: str) -> None:
    with pytest.raises(SpecError, match=said):
        margin(system(), vary, between, engine="corners")


def test_a_model_that_fails_is_an_error() -> None:
    with pytest.raises(SimulationError, match="out of order"):
        margin(lag_problem(response=never), "G[0,10] (x <= {limit})", (0, 1), engine="corners")


def test_what_is_known_when_the_user_stops_is_the_answer() -> None:
    searched: list[float] = []

    def stop(threshold: float, falsified: bool, count: int) -> None:
        searched.append(threshold)
        if len(searched) == 3:
            raise KeyboardInterrupt

    found = margin(
        lag_problem(), "G[0,10] (x <= {limit})", (0.0, 3.0), engine="corners", budget=60, searched=stop
    )
    assert found.interrupted and not found.complete
    assert found.unfalsified is not None and found.falsified is not None
    assert found.falsified < 1.0 < found.unfalsified
    assert found.text.endswith("stopped by the user")
