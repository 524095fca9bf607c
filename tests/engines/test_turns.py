import pytest

from falsifier.engines.turns import Half, Who, helps, is_worth_simulating, next_turn


def course(turns: int, *, llm: str = "", surrogate: str = "") -> str:
    """Who has each turn, L or S; the strings say which turns of a half help: ``+``, otherwise ``-``."""
    halves = {"llm": Half(), "surrogate": Half()}
    other: dict[Who, Who] = {"llm": "surrogate", "surrogate": "llm"}
    outcomes = {"llm": llm, "surrogate": surrogate}
    course = ""
    for _ in range(turns):
        who = next_turn(halves["llm"], halves["surrogate"])
        had = halves[who].turns
        helped = outcomes[who][had : had + 1] == "+"
        halves[who] = halves[who].had_turn(helped=helped)
        halves[other[who]] = halves[other[who]].yielded()
        course += "L" if who == "llm" else "S"
    return course


def test_an_llm_that_does_not_help_is_asked_ever_more_rarely() -> None:
    assert course(26) == "LSL" + 4 * "S" + "L" + 16 * "S" + "L" + "S"


def test_an_llm_keeps_its_turn_as_long_as_its_answers_help() -> None:
    assert course(8, llm="-+++-") == "LSLLLLSL"


def test_a_surrogate_that_helps_keeps_its_turn_once_the_trial_is_over() -> None:
    assert course(13, surrogate="-+---+----") == "LSL" + 9 * "S" + "L"
    assert course(3, surrogate="+++") == "LSL", "the trial does not depend on what it brings"


def test_a_best_that_is_only_a_little_lower_does_not_count() -> None:
    assert not helps(1.0, float("inf")), "the first sample improves on nothing"
    assert helps(0.89, 1.0) and not helps(0.95, 1.0)
    assert helps(-1.2, -1.0) and not helps(-1.05, -1.0)
    assert not helps(None, 1.0)
    assert helps(0.5, 1.0, share=0.5) and not helps(0.6, 1.0, share=0.5)


@pytest.mark.parametrize(
    ("repeats", "promising", "trusted", "on_trial", "expected"),
    [
        # Before predictions have been tested, only the same experiment is not worth a simulation.
        (False, False, False, True, True),
        (True, True, False, True, False),
        (False, False, False, False, True),
        # Once they have been good, they decide, except on trial.
        (True, True, True, True, True),
        (True, False, True, True, False),
        (False, False, True, True, True),
        (False, False, True, False, False),
    ],
)
def test_when_a_later_answer_is_simulated(
    *, repeats: bool, promising: bool, trusted: bool, on_trial: bool, expected: bool
) -> None:
    found = is_worth_simulating(repeats=repeats, promising=promising, trusted=trusted, on_trial=on_trial)
    assert found is expected
