import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.engines import make_engine
from falsifier.engines.briefing import Briefing
from falsifier.engines.hybrid import Hybrid, Turns, helps
from falsifier.engines.llm import LLMEngine
from falsifier.engines.protocol import Engine, FollowsRun
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.scripted import ScriptedChat
from falsifier.problem.problem import Problem
from falsifier.testing import FREE, START, EngineContract, drive, lag_problem
from tests.engines.support import HASTY, level, wide_problem

# Nor does it depend on how many of the first simulations are the surrogate's own.
SETTINGS = replace(HASTY, pauses=0, bangs=1, probes=1)


@dataclass
class Script(LLMEngine):
    """Answers with constant inputs of these levels, a list an answer; an exception is raised."""

    answers: list[list[float] | Exception]
    problem: Problem
    name: str = "scripted"
    notes: list[Sequence[str]] = field(default_factory=list)
    heard: list[Evaluation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.briefing = Briefing(self.problem)

    def propose(self, count: int, notes: Sequence[str] = (), **_: Any) -> list[Candidate]:
        self.notes.append(tuple(notes))
        answer = self.answers[min(len(self.notes), len(self.answers)) - 1]
        if isinstance(answer, Exception):
            raise answer
        return [self._constant(level + 1e-3 * len(self.notes)) for level in answer[:count]]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.heard += evaluations

    def _constant(self, level: float) -> Candidate:
        signals = {r.name: Signal((0.0,), (level,), "constant") for r in self.problem.space.inputs}
        parameters = {p.name: 0.0 for p in self.problem.space.parameters}
        candidate = Candidate(signals, parameters, self.name, f"{level:g} throughout")
        return self.problem.space.admit(candidate)


def turns_taken(count: int, *, llm: str = "") -> str:
    """Who has each turn, L or S; the string says which answers of the LLM help: ``+``, otherwise ``-``."""
    turns, course = Turns(), ""
    for _ in range(count):
        if turns.is_llm_next:
            turns.answered(helped=llm[turns.answers : turns.answers + 1] == "+")
            course += "L"
        else:
            turns.waited += 1
            course += "S"
    return course


def test_turns_follow_what_the_llm_brings() -> None:
    assert turns_taken(20) == "LSLSSLSSSSLSSSSSSSSL", "ever more rarely"
    assert turns_taken(8, llm="-+++-") == "LSLLLLSL", "as long as its answers help"


def test_a_best_that_is_only_a_little_lower_does_not_count() -> None:
    assert helps(0.89, 1.0) and not helps(0.95, 1.0)
    assert helps(-1.2, -1.0) and not helps(-1.05, -1.0)


def hybrid(problem: Problem, answers: list[list[float] | Exception], seed: int = 0) -> tuple[Hybrid, Script]:
    script = Script(answers, problem)
    return Hybrid(problem, seed=seed, adviser=script, surrogate_settings=SETTINGS), script


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Engine:
        rng = np.random.default_rng(seed)
        levels: list[list[float] | Exception] = [list(rng.uniform(-0.9, 0.9, 5)) for _ in range(9)]
        return make_engine(
            "hybrid", problem, seed=seed, adviser=Script(levels, problem), surrogate_settings=SETTINGS
        )

    def problems(self) -> Sequence[Problem]:
        return [p for p in super().problems() if all(r.free for r in p.space.inputs)]

    def test_survives_failures(self) -> None:
        problem = lag_problem(free=FREE, parameters=[START])
        failed = partial(Evaluation, status="failed", reason="diverged")
        assert len(drive(self.make(problem, 1), failed, rounds=self.rounds)) == self.rounds

    def test_survives_a_plateau(self) -> None:
        problem = lag_problem(free=FREE, parameters=[START])
        asked = drive(self.make(problem, 1), partial(level, problem), rounds=self.rounds)
        assert len({c.key for c in asked}) > self.rounds / 2


def test_the_model_opens_and_both_hear_everything() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[0.5, -0.5], [0.0]])
    asked = drive(engine, partial(evaluate, problem), rounds=5)
    assert [c.origin for c in asked[:2]] == ["scripted", "hybrid"]
    assert asked[1].rationale.startswith("surrogate: ")
    assert len(script.heard) == 5
    assert len(engine.surrogate.history.samples) == 5
    assert isinstance(engine, FollowsRun), "what its run tells it is for the model"
    assert (engine.begin, engine.doubt) == (script.begin, script.doubt)


def test_a_later_answer_is_ranked_before_one_is_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.engines.hybrid._PROMISING", -1.0)
    problem = wide_problem()
    # Higher inputs give a higher x: the surrogate, once trained, must put 1.5 first.
    script = Script([[-1.5, 0.0, 1.5, -0.5, 0.5]], problem)
    engine = Hybrid(problem, seed=0, adviser=script, surrogate_settings=SETTINGS)
    asked = drive(engine, partial(evaluate, problem), rounds=25)
    later = [c for c in asked if c.origin == "scripted" and "predicted robustness" in c.rationale]
    assert later, "no answer was ranked"
    assert later[0].signals["u"].values[0] == pytest.approx(1.5, abs=0.01)


def course(asked: Sequence[Candidate]) -> str:
    return "".join("L" if c.origin == "scripted" else "S" for c in asked)


def test_a_new_answer_on_trial_is_simulated_at_once_and_a_poor_one_after_it_is_dropped() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[-1.0], [0.0], [-0.5]])
    judge = partial(evaluate, problem)
    assert course(drive(engine, judge, rounds=40)) == "LSL" + 37 * "S"
    assert len(script.notes) > 2, "it was asked again"


def test_an_answer_that_repeats_a_sample_is_not_simulated_and_the_model_is_told() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[-1.0], [-1.1], [-1.2]])
    judge = partial(evaluate, problem)
    asked = drive(engine, judge, rounds=3)
    assert not engine.turns.is_llm_next, "an answer that was not simulated has not helped"
    asked += drive(engine, judge, rounds=37)
    assert course(asked) == "L" + 39 * "S"
    told = [n for n in script.notes[2] if "was not simulated: sample 1 differs from it by at most" in n]
    assert len(told) == 1 and "10 % of each range" in told[0]


def test_samples_are_called_by_no_number_where_those_told_are_numbered_anew() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[-1.0], [-1.1], [-1.2]])
    script.briefing = Briefing(problem, variant="MP4")
    drive(engine, partial(evaluate, problem), rounds=40)
    notes = "\n".join(script.notes[2])
    assert "not simulated: an earlier sample differs from it" in notes
    assert "shares this search chose: An earlier sample: surrogate: " in notes


@pytest.mark.parametrize("rounding", [0.0, 1e-6])
def test_what_both_halves_would_do_next_is_simulated_once(rounding: float) -> None:
    problem = wide_problem()
    engine, _ = hybrid(problem, [[0.1]])

    class Agrees(Script):
        def propose(self, count: int, notes: Sequence[str] = (), **_: Any) -> list[Candidate]:
            told = engine._next
            if told is None:
                return super().propose(count, notes)
            signals = {
                name: replace(s, values=tuple(v * (1 - rounding) for v in s.values))
                for name, s in told.signals.items()
            }
            return [replace(told, signals=signals, origin=self.name)]

    engine.adviser = Agrees([[0.1]], problem)
    asked = drive(engine, partial(evaluate, problem), rounds=8)
    assert course(asked)[:3] == "LSL"
    points = np.array([engine.surrogate.layout.point(c) for c in asked])
    distances = np.abs(points[:, None] - points).max(axis=2)[np.triu_indices(len(asked), 1)]
    assert distances.min() > 1e-3


def test_the_model_is_told_of_a_stall_and_is_asked_ever_more_rarely() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[0.1, 0.2], [0.3, 0.4, 0.5]])
    drive(engine, partial(level, problem), rounds=60)
    assert any("brought no new best" in note for note in script.notes[1])
    assert len(script.notes) <= 6


def test_the_model_is_told_why_the_surrogate_chose_its_samples() -> None:
    problem = wide_problem("G[0,10] (x <= 9 or u <= 1)")
    engine, script = hybrid(problem, [[0.1], [0.3]])
    drive(engine, partial(evaluate, problem), rounds=4)
    (reasons,) = (note for note in script.notes[1] if "numerical optimiser that shares this search" in note)
    assert "Sample 2: surrogate: steps through many levels of each input" in reasons
    assert any(note.startswith("The optimiser would simulate this next") for note in script.notes[1])


def test_the_model_is_told_when_the_surrogate_errs() -> None:
    problem = wide_problem("G[0,10] (x <= 1)")
    engine, script = hybrid(problem, [[-1.0, 0.5], [0.0]])
    rng = np.random.default_rng(0)
    # The requirement is judged by another margin than the trajectories show.
    drive(engine, lambda c: level(problem, c, 0.5 + float(rng.random())), rounds=40)
    told = [line for notes in script.notes for line in notes]
    assert any("was wrong each time" in line for line in told)


def test_without_an_opening_answer_the_run_fails_and_later_it_goes_on() -> None:
    problem = wide_problem()
    engine, _ = hybrid(problem, [ChatError("no key")])
    with pytest.raises(ChatError, match="no key"):
        engine.ask()
    engine, script = hybrid(problem, [[0.1, 0.2], ChatError("timeout")])
    asked = drive(engine, partial(level, problem), rounds=20)
    assert len(script.notes) > 1
    assert {c.origin for c in asked[1:]} == {"hybrid"}
    (remark,) = engine.remarks([])
    assert "had no valid answer, and the surrogate continued: timeout" in remark


def test_a_scripted_chat_leads_through_the_real_prompts() -> None:
    problem = wide_problem()

    def answer(*levels: float) -> str:
        signals = [[{"name": "u", "values": [level] * 4}] for level in levels]
        return json.dumps({"candidates": [{"rationale": "a guess", "signals": s} for s in signals]})

    chat = ScriptedChat([answer(0.1, 0.2), answer(0.3, 0.4, 0.5, 0.6, 0.7), answer(1.5)])
    adviser = LLMEngine(problem, chat)
    engine = Hybrid(problem, seed=0, adviser=adviser, surrogate_settings=SETTINGS)
    asked = drive(engine, partial(evaluate, problem), rounds=10)
    assert [c.origin for c in asked[:2]] == [adviser.name, "hybrid"]
    assert {c.origin for c in asked} == {adviser.name, "hybrid"}
    assert len(chat.requests) >= 2
    assert "The optimiser would simulate this next" in chat.requests[1].messages[-1].content
