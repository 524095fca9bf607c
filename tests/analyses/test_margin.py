from typing import Any

import numpy as np
import pytest

from falsifier.analyses.margin import Margin, margin
from falsifier.errors import SimulationError, SpecError
from falsifier.problem.problem import Problem
from falsifier.search.events import Evaluated, Event
from falsifier.search.loop import search
from falsifier.testing import BIAS, lag_problem
from tests.problems import never, straight


def system() -> Problem:
    return lag_problem(inputs=0, parameters=[BIAS], response=straight)


@pytest.mark.parametrize(
    ("vary", "high", "hardest"),
    [("G[0,10] (x <= {limit})", 3, 1.0), ("x >= {limit}", 3, -1.0), ("x <= {limit} ^2", -0.1, -1.0)],
)
def test_the_threshold_is_found_in_either_direction(vary: str, high: float, hardest: float) -> None:
    found = margin(system(), vary, (-3, high), engine="corners", budget=60)
    assert found.falsified_at is not None and found.unfalsified_at is not None
    below, above = sorted((found.falsified_at, found.unfalsified_at))
    assert below <= hardest <= above <= below + 0.06 and found.complete
    assert found.simulations <= 60
    assert "falsified at" in found.text


def test_ends_of_the_range_are_said_to_be_so() -> None:
    always = margin(system(), "G[0,10] (x <= {limit})", (-0.9, 0.5), engine="corners", budget=40)
    assert (always.falsified_at, always.unfalsified_at) == (0.5, None)
    assert "in the whole range, even at 0.5" in always.text
    nothing = margin(system(), "G[0,10] (x <= {limit})", (1.5, 3), engine="corners", budget=40)
    assert (nothing.falsified_at, nothing.unfalsified_at) == (None, 1.5)
    assert "not even at 1.5" in nothing.text
    assert nothing.simulations == 40  # what is left is spent at the easy end before this is said


def test_a_threshold_that_decides_nothing_here_is_searched_all_the_same() -> None:
    implied = "(G[0,10] (u >= 2)) -> (G[0,10] (x <= {limit}))"
    found = margin(lag_problem(), implied, (0, 3), engine="corners", budget=20)
    assert (found.falsified_at, found.unfalsified_at, found.simulations) == (None, 0, 20)


def test_thresholds_are_exactly_those_that_are_shown() -> None:
    found = margin(system(), "G[0,10] (x <= {limit})", (-3, 3), engine="uniform", budget=60)
    assert found.falsified_at is not None and found.unfalsified_at is not None
    for threshold in (found.falsified_at, found.unfalsified_at):
        assert f" at {threshold:.4f}".rstrip("0") in found.text
        assert threshold == round(threshold, 4)
    assert found.falsified_at < 1 and found.falsified_at < found.unfalsified_at


def test_what_was_searched_in_vain_is_not_named_after_another_search_has_reached_it() -> None:
    def at(seed: int) -> Margin:
        return margin(system(), "G[0,10] (x <= {limit})", (0.5, 0.9), engine="uniform", budget=20, seed=seed)

    found = [at(seed) for seed in range(12)]
    overtaken = [f for f in found if f.searches[0] == (0.9, False) and f.falsified_at == 0.9]
    assert overtaken and all(f.unfalsified_at is None for f in overtaken)


def test_thresholds_in_windows_fit_the_time_grid() -> None:
    problem = lag_problem()
    found = margin(problem, "G[0,{limit}] (x <= 0.5)", (0.1, 8), engine="corners", budget=40)
    assert found.falsified_at is not None and found.unfalsified_at is not None
    assert found.unfalsified_at < found.falsified_at
    for threshold in (found.falsified_at, found.unfalsified_at):
        steps = threshold / problem.experiment.output_interval
        assert steps == pytest.approx(round(steps))


def test_templates_are_taken_like_formulas() -> None:
    found = margin(
        system(), "stays_within signal=x low=-3 high={limit}", (-3, 3), engine="corners", budget=60
    )
    assert found.falsified_at is not None and found.falsified_at <= 1.0


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
        ("G[0,10] (x <= {limit})", (-1e308, 1e308), "between: -1e.308 and 1e.308 are too far apart"),
        ("G[0,10] (x <= {limit})", (0, 10**400), "between: expected a finite number"),
        ("G[0,10] (x <= {limit} - {limit})", (0, 1), "robustness is the same"),
        ("G[0,10] (abs(x - {limit}) <= 1)", (0, 1), "changes in either direction"),
        ("G[0,10] (x <= {limit}", (0, 1), r"vary with .* = 0: expected '\)' before the end"),
        ("G[0,{limit}] (x <= 1)", (5, 50), r"vary with \{limit\} = 50: .*50 s"),
    ],
)
def test_wrong_questions_are_refused(vary: str, between: tuple[float, float], said: str) -> None:
    with pytest.raises(SpecError, match=said):
        margin(system(), vary, between, engine="corners")


def test_an_engine_that_needs_a_language_model_is_refused() -> None:
    with pytest.raises(SpecError, match="needs a language model"):
        margin(system(), "G[0,10] (x <= {limit})", (0, 1), engine="hybrid")


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
    assert found.unfalsified_at is not None and found.falsified_at is not None
    assert found.falsified_at < 1.0 < found.unfalsified_at
    assert found.text.endswith("stopped by the user")


def test_what_a_stopped_search_has_simulated_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(event: Event) -> None:
        if isinstance(event, Evaluated) and event.index == 5:
            raise KeyboardInterrupt

    def stopped(*given: Any, listeners: list[Any]) -> Any:
        return search(*given, listeners=[*listeners, stop])

    monkeypatch.setattr("falsifier.analyses.margin.search", stopped)
    found = margin(lag_problem(), "G[0,10] (x <= {limit})", (0.0, 3.0), engine="corners", budget=60)
    assert (found.interrupted, found.searches, found.simulations) == (True, (), 6)
    assert found.falsified_at is not None and 0.0 < found.falsified_at < 1.0


@pytest.mark.parametrize(("extra", "above"), [(0.3, -1.0), (1.5, 0.98)])
def test_a_clearer_violation_counts_where_that_of_a_harder_threshold_is_not_confirmed(
    extra: float, above: float
) -> None:
    """Each input, or one of them, reaches more the first time, which no repetition confirms."""
    known = set[float]()

    def fading(times: Any, inputs: Any, parameters: dict[str, float]) -> dict[str, Any]:
        bias, more = parameters["bias"], extra if parameters["bias"] >= above else 0.0
        x = bias if bias in known else bias + more
        known.add(bias)
        return {"x": np.full(times.shape, x)}

    problem = lag_problem(inputs=0, parameters=[BIAS], response=fading)
    found = margin(problem, "G[0,10] (x <= {limit})", (-3, 3), engine="corners", budget=60)
    assert found.falsified_at is not None and 0.98 < found.falsified_at < 1.0
    assert found.unfalsified_at is not None and found.unfalsified_at > 1.0, "1.0 is reached by the first one"


def test_a_search_whose_few_simulations_fail_is_one_in_vain_if_most_of_all_do_not() -> None:
    def some(times: Any, inputs: Any, parameters: dict[str, float]) -> dict[str, Any]:
        lost = 1000 * parameters["bias"] % 1 < 0.4
        return {"x": np.full(times.shape, np.nan if lost else parameters["bias"])}

    problem = lag_problem(inputs=0, parameters=[BIAS], response=some)
    found = margin(problem, "G[0,10] (x <= {limit})", (-3, 3), engine="uniform", budget=20)
    assert found.falsified_at is not None and found.simulations == 20


def test_whoever_stops_it_again_gets_what_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("falsifier.analyses.margin.confirm", stop)
    found = margin(lag_problem(), "G[0,10] (x <= {limit})", (0.0, 3.0), engine="corners", budget=60)
    assert found.interrupted and found.text.endswith("stopped by the user")
