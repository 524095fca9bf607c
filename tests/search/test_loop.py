import signal
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from math import inf
from pathlib import Path
from time import sleep
from typing import Any

import pytest

from falsifier.analyses.assess import assess
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import InputRange, ParameterRange, ValueKind
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.engines import make_engine
from falsifier.errors import ChatError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.messages import ChatReply, ChatRequest, Usage
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.record.journal import read_journal
from falsifier.record.records import AskedRecord, EndedRecord
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.events import Evaluated, Event, RunEnded, RunStarted
from falsifier.search.loop import search
from falsifier.search.result import Result
from falsifier.search.steps import Steps
from falsifier.stl import parse
from falsifier.stl.margins import is_on_limit
from falsifier.testing import FREE, START, Response, lag, lag_problem
from tests.problems import mostly_broken, still
from tests.record.support import run
from tests.searches import Wrapped


def test_stops_at_the_first_confirmed_violation() -> None:
    events: list[Event] = []
    result = falsify(lag_problem(), "corners", budget=20, listeners=[events.append])
    assert result.status == "falsified"
    assert result.counterexample is not None
    found = result.counterexample.evaluation
    assert found.candidate.signals["u"].values == (1.0, 1.0, 1.0, 1.0)
    # x(10) of x' = 1 - x by Euler with 0.1 s: 1 - 0.9**100
    assert found.robustness == pytest.approx(0.9 - (1 - 0.9**100))
    assert result.counterexample.reference == pytest.approx(found.robustness)
    assert result.spent.simulations == len(result.evaluations) <= 2
    assert isinstance(events[0], RunStarted)
    assert isinstance(events[-1], RunEnded)
    assert sum(isinstance(e, Evaluated) for e in events) == result.spent.simulations


def test_uses_the_budget_up_and_says_so() -> None:
    result = run(lag_problem("G[0,10] (x <= 2)"), budget=7)
    assert result.status == "not falsified"
    assert result.spent.simulations == 7
    assert "7 simulations" in result.reason
    assert all(e.trajectory is None for e in result.evaluations), "they would fill the memory"
    assert result.best is not None
    assert result.best.robustness == min(e.robustness for e in result.evaluations if e.robustness is not None)


def test_only_values_within_the_models_limits_are_searched() -> None:
    wide = replace(lag_problem(), space=SearchSpace((InputRange("u", -50, 1),), (), 10.0))
    with pytest.raises(SpecError, match=r"LAG: .* exceeds the model's limits for 'u', .*; narrow the range"):
        run(wide, budget=1)
    with pytest.raises(SpecError, match="narrow the range"):
        assess(wide, budget=1)


@pytest.mark.parametrize(
    ("comparison", "violates"),
    [
        *((text, False) for text in ("x - x <= 0", "x - x == 0", "not (x - x != 0)")),
        *((text, True) for text in ("x - x < 0", "x - x != 0", "not (x - x >= 0)")),
    ],
)
def test_on_its_limit_the_comparison_decides(comparison: str, violates: bool) -> None:
    result = run(lag_problem(f"G[0,10] ({comparison})"), budget=3)
    assert (result.status, result.spent.simulations) == (
        ("falsified", 1) if violates else ("not falsified", 3)
    )
    assert result.robustness is not None and is_on_limit(result.robustness)


def test_a_run_in_which_most_simulations_fail_has_failed() -> None:
    result = run(lag_problem("G[0,10] (x <= 2)", response=mostly_broken), budget=20)
    failures = sum(e.status == "failed" for e in result.evaluations)
    assert 10 < failures < 20
    assert (result.status, result.spent.failed) == ("failed", failures)
    assert result.reason.startswith(f"{failures} of 20 simulations failed; the last error: ")
    assert "'x' is nan at t = 0.5 s" in result.reason
    assert result.best is not None
    assert result.spent.simulations_text == f"20 simulations, {failures} of them failed"


def test_the_time_of_a_question_that_is_interrupted_is_the_engines() -> None:
    class Asked(Wrapped):
        def ask(self, n: int = 1) -> list[Candidate]:
            sleep(0.05)
            raise KeyboardInterrupt

    result = falsify(lag_problem(), Asked(lag_problem()))
    assert result.status == "interrupted" and result.spent.engine_seconds >= 0.05


@pytest.mark.usefixtures("stoppable")
@pytest.mark.parametrize(
    ("within", "kind"), [("search.loop.judge", "evaluated"), ("search.events.Confirmed", "confirmed")]
)
def test_what_was_simulated_is_recorded_before_ctrl_c_ends_the_run(
    within: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, _, name = f"falsifier.{within}".rpartition(".")
    original = getattr(import_module(module), name)

    def interrupted(*arguments: Any, **options: Any) -> object:
        signal.raise_signal(signal.SIGINT)
        return original(*arguments, **options)

    monkeypatch.setattr(f"falsifier.{within}", interrupted)
    monkeypatch.setattr("falsifier.search.loop._WORTH_KEEPING", 0.0)
    problems = [lag_problem(name="A"), lag_problem(name="B")]
    results = falsify(problems, "corners", budget=20, directory=tmp_path)
    assert "interrupted" in {result.status for result in results}
    assert [r.kind for r in read_journal(tmp_path)][-2:] == [kind, "ended"]


def test_batches_are_told_in_the_order_of_asking() -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    with ThreadPoolExecutor(3) as executor:
        engines = [make_engine("uniform", problem, seed=5)]
        (parallel,) = search([problem], engines, Budget(10), jobs=4, steps=Steps(executor))
    (alone,) = search([problem], [make_engine("uniform", problem, seed=5)], Budget(10), jobs=4)
    assert len(parallel.evaluations) == 10
    assert [e.candidate.key for e in parallel.evaluations] == [e.candidate.key for e in alone.evaluations]


class Silent(Wrapped):
    """An engine whose language model gives up after two candidates."""

    asked = 0

    def ask(self, n: int = 1) -> list[Candidate]:
        self.asked += 1
        if self.asked > 2:
            raise ChatError("no usable reply")
        return self.inner.ask(n)


def test_a_silent_language_model_ends_the_run_with_everything_kept(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    result = falsify(problem, Silent(problem), budget=20, directory=tmp_path)
    assert (result.status, result.reason) == ("failed", "no usable reply")
    assert len(result.evaluations) == 2
    records = read_journal(tmp_path)
    assert [r.kind for r in records] == ["asked", "evaluated", "asked", "evaluated", "ended"]
    assert isinstance(records[0], AskedRecord)
    assert isinstance(records[-1], EndedRecord)
    assert records[-1].status == "failed"


def test_a_refuted_violation_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    def refute(problem: Problem, evaluation: Evaluation) -> Confirmation:
        return replace(confirm(problem, evaluation), outcome="refuted", reason="did not happen again")

    monkeypatch.setattr("falsifier.search.steps.confirm", refute)
    result = run(lag_problem(), engine="corners", budget=4)
    assert result.status == "not falsified"
    assert result.counterexample is None
    assert [c.reason for c in result.refuted] == ["did not happen again"]


def whole(problem: Problem, kind: ValueKind) -> Problem:
    """Three candidates in all, where the kind is integer."""
    (u,) = problem.space.inputs
    inputs = (replace(u, control_points=1, interpolation="constant", kind=kind),)
    return replace(problem, space=replace(problem.space, inputs=inputs))


@pytest.mark.parametrize("engine", ["surrogate", "coverage", "corners", "uniform", "cma", "bayesian"])
def test_a_search_of_few_whole_numbers_ends_when_all_were_simulated(engine: str) -> None:
    problem = whole(lag_problem("G[0,10] (x <= 2)"), "integer")
    result = run(problem, engine=engine, budget=60)
    assert result.reason == "the whole search space was simulated, 3 candidates"
    assert {e.candidate.signals["u"].values for e in result.evaluations} == {(-1.0,), (0.0,), (1.0,)}


@pytest.mark.parametrize("response", [lag, still])
def test_no_more_simulations_are_advised_when_all_were_simulated(response: Response) -> None:
    problem = whole(lag_problem("G[0,0] (x <= 2)", response=response), "integer")
    assert "Search longer" in run(problem, engine="uniform", budget=2).findings[0].text
    for findings in (run(problem, engine="uniform", budget=60).findings, assess(problem, budget=60).findings):
        assert findings[0].kind == "constant" and "longer" not in findings[0].text


def test_candidates_with_other_control_points_are_none_of_the_search_space() -> None:
    fixed = whole(lag_problem("G[0,10] (x <= 2)"), "integer")
    (u,) = fixed.space.inputs
    problem = replace(fixed, space=replace(fixed.space, inputs=(replace(u, free=FREE),)))
    known = [Candidate({"u": Signal((0.0, t), (0.0, 1.0), "constant")}) for t in (2.0, 4.0, 6.0)]
    result = falsify(problem, "uniform", budget=60, start_from=known)
    assert isinstance(result, Result) and result.reason.startswith("the whole search space was simulated")
    assert len({e.candidate.key for e in result.evaluations}) == 6


def test_minus_one_and_minus_two_are_two_candidates() -> None:
    bias = ParameterRange("bias", -2, -1, kind="integer")  # their hashes are equal
    result = run(lag_problem("G[0,10] (x <= 2)", inputs=0, parameters=[bias]), budget=60)
    assert result.reason == "the whole search space was simulated, 2 candidates"


def test_a_record_that_goes_on_when_all_were_simulated_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = whole(lag_problem("G[0,10] (x <= 2)"), "integer")
    with monkeypatch.context() as earlier:
        earlier.setattr(SearchSpace, "candidates", inf)
        assert run(problem, tmp_path, budget=20).spent.simulations == 20
    (resumed,) = resume(tmp_path, problems=[problem], budget=30)
    assert resumed.spent.simulations == 20
    assert resumed.reason == "the whole search space was simulated, 3 candidates"


def test_problems_that_are_simulated_in_different_ways_cannot_share_a_search() -> None:
    problems = lag_problem(name="one"), lag_problem(name="other", points=5)
    engines = [make_engine("uniform", each, seed=1) for each in problems]
    with pytest.raises(SpecError, match=r"one and other differ in what is varied .* one after the other"):
        search(problems, engines, Budget(1))


def test_only_whole_numbers_at_given_times_can_be_counted() -> None:
    space = whole(lag_problem(inputs=1), "integer").space
    assert space.candidates == 3
    (u,) = space.inputs
    gear, still = ParameterRange("gear", 1, 4, kind="integer"), ParameterRange("still", 0.5, 0.5)
    given = replace(u, control_points=2)
    assert replace(space, inputs=(given,), parameters=(gear, still)).candidates == 3**2 * 4
    assert replace(space, inputs=(replace(given, free=FREE),)).candidates == inf
    assert replace(space, parameters=(START,)).candidates == inf
    many = replace(u, control_points=2000)
    for parameters in ((START,), (replace(gear, high=1e30),)):  # numbers too large for some calculations
        assert replace(space, inputs=(many,), parameters=parameters).candidates == inf


def unusable(request: ChatRequest) -> ChatReply:
    """Answer what cannot be read, for 100 tokens."""
    return ChatReply(text="[]", usage=Usage(prompt_tokens=90, completion_tokens=10, cost=0.0))


@pytest.mark.parametrize(("tokens", "simulated"), [(150, 0), (350, 1)])
def test_a_language_model_without_a_usable_answer_is_a_failure(tokens: int, simulated: int) -> None:
    """Also if random samples were simulated in place of an answer."""
    result = falsify(lag_problem(), llm=ScriptedChat(unusable), budget=Budget(None, tokens=tokens))
    assert (result.status, result.spent.simulations) == ("failed", simulated)
    assert f"the budget of {tokens} tokens is used up; the language model gave no usable" in result.reason
    assert result.reason.endswith("nothing was simulated") == (not simulated)
    known = falsify(
        lag_problem(),
        llm=ScriptedChat(unusable),
        budget=Budget(None, tokens=tokens),
        start_from=[Candidate({"u": Signal((0.0,), (0.1,))})],
    )
    assert (known.status, known.spent.simulations) == ("failed", simulated + 1)


def test_after_one_usable_answer_a_limit_is_the_end_of_the_search() -> None:
    script = ['{"signals": [{"name": "u", "values": [0, 0, 0, 0]}]}', *["[]"] * 9]
    replies = iter(script)

    def answer(request: ChatRequest) -> ChatReply:
        return unusable(request).model_copy(update={"text": next(replies)})

    result = falsify(lag_problem(), llm=ScriptedChat(answer), budget=Budget(None, tokens=250))
    assert (result.status, result.spent.simulations) == ("not falsified", 1)


def test_the_shortest_time_leaves_one_simulation() -> None:
    result = falsify(lag_problem("G[0,10] (x <= 2)"), "uniform", budget=Budget(5, seconds=1e-9))
    assert (result.status, len(result.evaluations)) == ("not falsified", 1)
    assert result.reason == "the time limit of 1e-09 s is reached"


def test_known_candidates_come_first_and_once_where_requirements_share_the_search() -> None:
    one = lag_problem("G[0,10] (x <= 5)")
    other = replace(one, requirement=Requirement("other", parse("G[0,10] (x >= -5)")))
    known = make_engine("uniform", one, seed=9).ask(3)
    engines = [make_engine("uniform", each, seed=1) for each in (one, other)]
    for budget in (3, 4):
        results = search([one, other], engines, Budget(budget), known=known)
        keys = [e.candidate.key for e in results[1].evaluations]
        assert keys[:3] == [c.key for c in known] and len(set(keys)) == budget
        assert results[0].status == "not falsified"
