import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.engines import make_engine
from falsifier.engines.adviser import Advice
from falsifier.engines.hybrid import Hybrid
from falsifier.engines.llm import make_llm_engine
from falsifier.engines.protocol import Engine
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat
from falsifier.llm.scripted import ScriptedChat
from falsifier.llm.tools import WhatIf
from falsifier.problem.problem import Problem
from falsifier.testing import BIAS, FREE, START, EngineContract, drive, lag_problem, simulated
from tests.engines.support import HASTY, wide_problem

# Nor does it depend on how many of the first simulations are the surrogate's own.
SETTINGS = replace(HASTY, constants=0, bangs=1, probes=1)


@dataclass
class Script:
    """Answers with constant inputs of these levels, a list an answer; an exception is raised."""

    answers: list[list[float] | Exception]
    problem: Problem
    name: str = "scripted"
    notes: list[Sequence[str]] = field(default_factory=list)
    told: list[Evaluation] = field(default_factory=list)

    def propose(
        self,
        count: int,
        notes: Sequence[str] = (),
        *,
        what_if: WhatIf | None = None,
        dispensable: bool = False,
    ) -> Advice:
        self.notes.append(tuple(notes))
        answer = self.answers[min(len(self.notes), len(self.answers)) - 1]
        if isinstance(answer, Exception):
            raise answer
        return Advice([self._constant(level + 1e-3 * len(self.notes)) for level in answer[:count]])

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """It asks nobody."""

    def describe(self, candidate: Candidate) -> str:
        return str(candidate.key)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.told += evaluations

    def _constant(self, level: float) -> Candidate:
        signals = {r.name: Signal((0.0,), (level,), "constant") for r in self.problem.space.inputs}
        parameters = {p.name: 0.0 for p in self.problem.space.parameters}
        candidate = Candidate(signals, parameters, self.name, f"{level:g} throughout")
        return self.problem.space.admit(candidate)


def hybrid(problem: Problem, answers: list[list[float] | Exception], seed: int = 0) -> tuple[Hybrid, Script]:
    script = Script(answers, problem)
    return Hybrid(problem, seed=seed, adviser=script, surrogate_settings=SETTINGS), script


class TestContract(EngineContract):
    def make(self, problem: Problem, seed: int) -> Engine:
        if not all(r.free for r in problem.space.inputs):
            problem = lag_problem(inputs=0, parameters=[START, BIAS])
        rng = np.random.default_rng(seed)
        levels: list[list[float] | Exception] = [list(rng.uniform(-0.9, 0.9, 5)) for _ in range(9)]
        return make_engine(
            "hybrid", problem, seed=seed, adviser=Script(levels, problem), surrogate_settings=SETTINGS
        )

    def problems(self) -> Sequence[Problem]:
        return [p for p in super().problems() if all(r.free for r in p.space.inputs)]

    def test_survives_failures(self) -> None:
        problem = lag_problem(free=FREE, parameters=[START])
        asked = drive(
            self.make(problem, 1), lambda c: Evaluation(c, "failed", reason="diverged"), rounds=self.rounds
        )
        assert len(asked) == self.rounds

    def test_survives_a_plateau(self) -> None:
        problem = lag_problem(free=FREE, parameters=[START])
        asked = drive(self.make(problem, 1), simulated(problem, lambda x: 0.5), rounds=self.rounds)
        assert len({c.key for c in asked}) > self.rounds / 2


def test_the_model_opens_and_both_hear_everything() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[0.5, -0.5], [0.0]])
    asked = drive(engine, simulated(problem, lambda x: float(9 - x.max())), rounds=5)
    assert [c.origin for c in asked] == ["scripted", "scripted", "hybrid", "hybrid", "hybrid"]
    assert all(c.rationale.startswith("surrogate: ") for c in asked[2:])
    assert len(script.told) == 5
    assert len(engine.surrogate.history.samples) == 5


def test_a_later_answer_is_ranked_before_one_is_simulated() -> None:
    problem = wide_problem()
    # Higher inputs give a higher x: the surrogate, trained by then, must put 1.5 first.
    engine, script = hybrid(problem, [[-1.0, 1.8], [-1.5, 0.0, 1.5, -0.5, 0.5]])
    asked = drive(engine, simulated(problem, lambda x: float(9 - x.max())), rounds=25)
    later = [c for c in asked[2:] if c.origin == "scripted"]
    assert later, "the model was not asked again"
    assert later[0].signals["u"].values[0] == pytest.approx(1.5, abs=0.01)
    assert "predicted robustness" in later[0].rationale
    assert any("predicts robustness" in line for notes in script.notes for line in notes)


def test_the_model_is_told_of_a_stall_and_is_asked_ever_more_rarely() -> None:
    problem = wide_problem()
    engine, script = hybrid(problem, [[0.1, 0.2], [0.3, 0.4, 0.5]])
    drive(engine, simulated(problem, lambda x: 0.5), rounds=60)
    assert any("brought no new best" in note for note in script.notes[1])
    assert len(script.notes) <= 10


def test_the_model_is_told_when_the_surrogate_errs() -> None:
    problem = wide_problem("G[0,10] (x <= 1)")
    engine, script = hybrid(problem, [[-1.0, 0.5], [0.0]])
    rng = np.random.default_rng(0)
    # The requirement is judged by another margin than the trajectories show.
    drive(engine, simulated(problem, lambda x: 0.5 + float(rng.random())), rounds=40)
    told = [line for notes in script.notes for line in notes]
    assert any("was wrong each time" in line for line in told)


def test_without_an_opening_answer_the_run_fails_and_later_it_goes_on() -> None:
    problem = wide_problem()
    engine, _ = hybrid(problem, [ChatError("no key")])
    with pytest.raises(ChatError, match="no key"):
        engine.ask()
    engine, script = hybrid(problem, [[0.1, 0.2], ChatError("timeout")])
    asked = drive(engine, simulated(problem, lambda x: 0.5), rounds=20)
    assert len(script.notes) > 1
    assert {c.origin for c in asked[2:]} == {"hybrid"}


def test_a_scripted_chat_leads_through_the_real_prompts() -> None:
    problem = wide_problem()

    def answer(*levels: float) -> str:
        signals = [[{"name": "u", "values": [level] * 4}] for level in levels]
        return json.dumps({"candidates": [{"rationale": "a guess", "signals": s} for s in signals]})

    chat = ScriptedChat([answer(0.1, 0.2), answer(0.3, 0.4, 0.5, 0.6, 0.7), answer(1.5)])
    adviser = make_llm_engine(problem, chat)
    engine = Hybrid(problem, seed=0, adviser=adviser, surrogate_settings=SETTINGS)
    asked = drive(engine, simulated(problem, lambda x: float(9 - x.max())), rounds=10)
    assert [c.origin for c in asked[:2]] == [adviser.name] * 2
    assert {c.origin for c in asked} == {adviser.name, "hybrid"}
    assert len(chat.requests) >= 2
    assert "brought no new best" in chat.requests[1].messages[-1].content
