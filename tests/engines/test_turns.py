from dataclasses import replace

import pytest

from falsifier.engines.turns import (
    ASSUMED_QUESTION,
    SECONDS_PER_DOLLAR,
    Costs,
    Due,
    Half,
    Ledger,
    Who,
    due,
    helps,
    next_turn,
)
from falsifier.llm.messages import ChatReply, Exchange, Usage

ALIKE = Costs(simulation=300.0, proposal=0.1, question=10.0)
CHEAP = Costs(simulation=0.005, proposal=0.001, question=10.0)


def course(
    costs: Costs, turns: int, *, llm: str = "", surrogate: str = "", simulations: int | None = None
) -> str:
    """Who has each turn, L or S; the strings say which turns of a half help: ``+``, otherwise ``-``."""
    halves = {"llm": Half(), "surrogate": Half()}
    other: dict[Who, Who] = {"llm": "surrogate", "surrogate": "llm"}
    outcomes = {"llm": llm, "surrogate": surrogate}
    course = ""
    for _ in range(turns):
        who = next_turn(halves["llm"], halves["surrogate"], costs, simulations=simulations)
        had = halves[who].turns
        helped = outcomes[who][had : had + 1] == "+"
        halves[who] = halves[who].had_turn(helped=helped)
        halves[other[who]] = halves[other[who]].yielded()
        course += "L" if who == "llm" else "S"
    return course


def test_an_llm_that_does_not_help_is_asked_ever_more_rarely() -> None:
    assert course(ALIKE, 26) == "LSL" + 4 * "S" + "L" + 16 * "S" + "L" + "S"


def test_an_llm_keeps_its_turn_as_long_as_its_answers_help() -> None:
    assert course(ALIKE, 8, llm="-+++-") == "LSLLLLSL"


def test_a_surrogate_that_helps_keeps_its_turn_once_the_trial_is_over() -> None:
    assert course(ALIKE, 13, surrogate="-+---+----") == "LSL" + 9 * "S" + "L"


def test_the_trial_does_not_depend_on_what_the_surrogate_brings() -> None:
    assert course(ALIKE, 3, surrogate="+++") == "LSL"


def test_cheap_simulations_give_the_surrogate_most_turns_and_dear_ones_the_llm() -> None:
    helpful = "-" + 50 * "+"
    cheap, dear = (course(replace(c, question=10.0), 3400, llm=helpful) for c in (CHEAP, ALIKE))
    assert cheap.count("L") < 0.01 * len(cheap)
    assert dear[:50].count("L") == 49


def test_simulations_that_are_known_to_be_cheap_go_before_the_first_question() -> None:
    assert course(replace(CHEAP, question=None), 9).startswith("SSSS")
    assert course(Costs(), 3) == "LSL"
    assert course(Costs(simulation=300.0), 3) == "LSL"


def test_the_wait_is_limited_to_a_share_of_the_simulations() -> None:
    assert course(CHEAP, 60, simulations=100)[:24] == 9 * "S" + "L" + 10 * "S" + "L" + "SSS"


def test_costs_count_money_and_the_proposal() -> None:
    assert Costs().ratio == 1.0
    assert Costs(simulation=1.0).ratio == 1.0 + ASSUMED_QUESTION
    assert Costs(simulation=1.0, question=0.0).ratio == 1.0
    assert Costs(simulation=0.5, proposal=0.5, question=10.5).ratio == pytest.approx(11.0)


def test_a_best_that_is_only_a_little_lower_does_not_count() -> None:
    assert not helps(1.0, float("inf")), "the first sample improves on nothing"
    assert helps(0.89, 1.0) and not helps(0.95, 1.0)
    assert helps(-1.2, -1.0) and not helps(-1.05, -1.0)
    assert not helps(None, 1.0)
    assert helps(0.5, 1.0, share=0.5) and not helps(0.6, 1.0, share=0.5)


def test_the_ledger_takes_times_from_what_it_is_told() -> None:
    ledger = Ledger()
    assert ledger.costs == Costs()
    exchange = Exchange(llm="x", messages=(), reply=ChatReply(text="", seconds=2.0, usage=Usage(cost=0.03)))
    ledger.begin(1)
    ledger.exchanged(exchange)
    ledger.exchanged(exchange)
    ledger.answered()
    ledger.asked(4.0)
    ledger.begin(4)
    ledger.asked(2.0)
    for seconds in (9.0, 1.0, 2.0, 0.0):
        ledger.simulated(seconds)
    assert (ledger.costs.simulation, ledger.costs.proposal) == (2.0, 0.5)
    assert ledger.costs.question == pytest.approx(4.0 + 0.06 * SECONDS_PER_DOLLAR)


@pytest.mark.parametrize(
    ("repeats", "promising", "trusted", "on_trial", "expected"),
    [
        # Before predictions have been tested, only the same experiment is not worth a simulation.
        (False, False, False, True, "now"),
        (True, True, False, True, "never"),
        # Once they have been good, they decide.
        (True, True, True, True, "now"),
        (True, False, True, True, "never"),
        (False, False, True, True, "later"),
        (False, False, True, False, "never"),
        # After the trial, an LLM that may be right waits while nothing is known.
        (False, True, False, False, "now"),
        (False, False, False, False, "later"),
    ],
)
def test_when_a_later_answer_is_simulated(
    repeats: bool, promising: bool, trusted: bool, on_trial: bool, expected: Due
) -> None:
    assert due(repeats=repeats, promising=promising, trusted=trusted, on_trial=on_trial) == expected
