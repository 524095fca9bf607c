"""Why a counterexample violates: what decided it, and which inputs and parameters it takes.

The way from the formula to the deciding predicate comes from the monitor. Which inputs matter comes from
ablation: each signal, each of its stretches and each parameter is put back to rest, alone, and the model is
simulated again.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange
from falsifier.core.words import candidate_lines, listed
from falsifier.counterexamples.shrink import constant_signal, stretches, with_signal
from falsifier.counterexamples.simplicity import rest_value
from falsifier.evaluation.evaluate import Evaluation, evaluate, monitor_for
from falsifier.problem.problem import Problem
from falsifier.stl import Diagnosis, in_words

if TYPE_CHECKING:
    from falsifier.llm.messages import Chat

_NARRATOR = (
    "You explain to a control engineer why a simulated system violates a requirement. Tell in one short "
    "paragraph of plain text what happens over time and which inputs bring it about. Use only what you are "
    "given; say what you merely suppose."
)
# Rows of the trajectory that a language model is shown, beside the critical one.
_ROWS = 21
# Stretches of one signal that are put back one by one; the longest are taken.
_MOST_STRETCHES = 12


@dataclass(frozen=True, slots=True)
class Effect:
    """What happens when one part of a counterexample is put back.

    Attributes:
        name: of the input or parameter.
        span: begin and end in s of what was put back; None for a parameter or a whole signal.
        instead: the value that it was put back to.
        is_rest: whether that is the value at rest; otherwise it is the middle of the range.
        was_rest: whether the part was at rest in the counterexample.
        robustness: then; None when the simulation failed.
    """

    name: str
    span: tuple[float, float] | None
    instead: float
    is_rest: bool
    was_rest: bool
    robustness: float | None

    @property
    def needed(self) -> bool:
        """Whether the violation vanishes without this part."""
        return self.robustness is not None and self.robustness >= 0

    @property
    def part(self) -> str:
        """What was put back, in words."""
        return f"{self.name} at rest" if self.was_rest else self.name


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a counterexample shows.

    Attributes:
        problem: what it violates.
        evaluation: the counterexample.
        diagnosis: the way from the formula to the predicate that decided.
        effects: of putting parts back: whole signals and parameters, then stretches.
    """

    problem: Problem
    evaluation: Evaluation
    diagnosis: Diagnosis
    effects: tuple[Effect, ...]

    @property
    def text(self) -> str:
        """One paragraph."""
        requirement = self.problem.requirement
        demand = requirement.description or in_words(requirement.formula)
        sentences = [
            f"{self.problem.name} demands: {demand.rstrip('.')}.",
            f"It is violated by {-self.diagnosis.robustness:.5g}: {self.diagnosis.text}",
            *self._effect_sentences(),
        ]
        return " ".join(sentences)

    def _effect_sentences(self) -> Iterator[str]:
        whole = [e for e in self.effects if e.span is None]
        needed = sorted((e for e in whole if e.needed), key=lambda e: -(e.robustness or 0.0))
        if needed:
            yield f"It takes {listed([self._part(e) for e in needed])}."
        idle = [e for e in whole if e.robustness is not None and not e.needed]
        if idle:
            yield f"It does not need {listed([self._without(e) for e in idle])}."
        for name in dict.fromkeys(e.name for e in needed):
            spans = [e for e in self.effects if e.name == name and e.span is not None]
            decisive = [e for e in spans if e.needed]
            if decisive and len(decisive) < len(spans):
                yield f"Of {name}, what counts is {listed([self._stretch(e) for e in decisive])}."
        failed = [e.name for e in whole if e.robustness is None]
        if failed:
            yield f"Without {listed(failed)} the simulation fails."

    def _part(self, effect: Effect) -> str:
        return f"{effect.part} ({self._instead(effect)} the robustness is {effect.robustness:+.4g})"

    def _without(self, effect: Effect) -> str:
        return f"{effect.part} ({self._instead(effect)} it is still {effect.robustness:+.4g})"

    def _stretch(self, effect: Effect) -> str:
        start, end = effect.span or (0.0, 0.0)
        return f"{start:.4g} to {end:.4g} s ({self._instead(effect)} {effect.robustness:+.4g})"

    def _instead(self, effect: Effect) -> str:
        unit = next((v.unit for v in self.problem.info.variables if v.name == effect.name), "")
        number = f"{effect.instead:.4g}" + (f" {unit}" if unit not in ("", "1") else "")
        return f"at {number}, {'its rest value' if effect.is_rest else 'the middle of its range'},"


def explain(problem: Problem, evaluation: Evaluation) -> Explanation:
    """Diagnose a counterexample and put its parts back one by one.

    Raises:
        ValueError: when the evaluation has no trajectory.
    """
    if evaluation.trajectory is None:
        raise ValueError("a simulation that failed cannot be explained")
    diagnosis = monitor_for(problem).diagnose(evaluation.trajectory)
    effects = tuple(_effects(problem, evaluation.candidate))
    return Explanation(problem, evaluation, diagnosis, effects)


def narrate(explanation: Explanation, chat: "Chat") -> str:
    """Have a language model tell an engineer what happens, from the findings and the trajectory alone.

    Raises:
        ChatError: when the LLM gives no answer.
    """
    from falsifier.llm.conversation import converse
    from falsifier.llm.messages import ChatRequest, Message

    messages = (
        Message(role="system", content=_NARRATOR),
        Message(role="user", content=_findings(explanation)),
    )
    return converse(chat, ChatRequest(messages=messages), str.strip, lambda exchange: None)


def _findings(explanation: Explanation) -> str:
    """What the language model is told: system, findings, inputs and a few rows of the trajectory."""
    problem, evaluation = explanation.problem, explanation.evaluation
    trajectory = evaluation.trajectory
    assert trajectory is not None
    described = [
        f"- {v.name}{f' [{v.unit}]' if v.unit else ''}: {v.description or v.causality}"
        for v in problem.info.variables
        if v.name in trajectory.names or v.name in evaluation.candidate.parameters
    ]
    last = len(trajectory) - 1
    samples = sorted(
        {*np.linspace(0, last, _ROWS).astype(int), trajectory.index(explanation.diagnosis.critical_time)}
    )
    rows = [
        ", ".join(f"{x:.5g}" for x in (trajectory.times[k], *(trajectory[n][k] for n in trajectory.names)))
        for k in samples
    ]
    return "\n".join(
        [
            f"System: {problem.info.description or problem.info.name}",
            "Signals:",
            *described,
            f"Formula: {problem.requirement.formula}",
            f"Findings: {explanation.text}",
            "Inputs:",
            *(f"- {line}" for line in candidate_lines(evaluation.candidate, problem.space)),
            "Trajectory:",
            ", ".join(("time", *trajectory.names)),
            *rows,
        ]
    )


def _effects(problem: Problem, candidate: Candidate) -> Iterator[Effect]:
    for r in problem.space.inputs:
        nominal = _nominal(problem, r, candidate.signals[r.name].values)
        changed = with_signal(candidate, r.name, constant_signal(problem, r, nominal.value))
        yield nominal.effect(None, _robustness(problem, changed))
    for p in problem.space.parameters:
        nominal = _nominal(problem, p, (candidate.parameters[p.name],))
        changed = replace(candidate, parameters={**candidate.parameters, p.name: nominal.value})
        yield nominal.effect(None, _robustness(problem, changed))
    for r in problem.space.inputs:
        signal = candidate.signals[r.name]
        nominal = _nominal(problem, r, signal.values)
        for first, end in _longest(signal):
            values = (*signal.values[:first], *(nominal.value,) * (end - first), *signal.values[end:])
            if values != signal.values:
                changed = with_signal(candidate, r.name, replace(signal, values=values))
                span = _span(signal, first, end, problem.space.stop_time)
                yield nominal.effect(span, _robustness(problem, changed))


@dataclass(frozen=True, slots=True)
class _Nominal:
    """What an input or parameter is put back to."""

    name: str
    value: float
    is_rest: bool
    was_rest: bool

    def effect(self, span: tuple[float, float] | None, robustness: float | None) -> Effect:
        return Effect(self.name, span, self.value, self.is_rest, self.was_rest, robustness)


def _nominal(problem: Problem, ranged: InputRange | ParameterRange, values: tuple[float, ...]) -> _Nominal:
    """Rest, or the middle of the range where rest is unknown or everything is at rest already."""
    rest = rest_value(problem, ranged.name)
    was_rest = rest is not None and all(v == rest for v in values)
    if rest is not None and not was_rest:
        return _Nominal(ranged.name, rest, is_rest=True, was_rest=False)
    return _Nominal(ranged.name, (ranged.low + ranged.high) / 2, is_rest=False, was_rest=was_rest)


def _longest(signal: Signal) -> list[tuple[int, int]]:
    """Stretches of equal values in time order, the longest where they are many; none where there is one."""
    found = stretches(signal.values)
    if len(found) < 2:
        return []
    return sorted(sorted(found, key=lambda s: s[0] - s[1])[:_MOST_STRETCHES])


def _span(signal: Signal, first: int, end: int, stop_time: float) -> tuple[float, float]:
    """Time over which control points reach: between the neighbours that stay, or until the next step."""
    finish = signal.times[end] if end < len(signal.times) else stop_time
    if signal.interpolation == "constant":
        return signal.times[first], finish
    return signal.times[max(first - 1, 0)], finish


def _robustness(problem: Problem, candidate: Candidate) -> float | None:
    return evaluate(problem, problem.space.admit(candidate)).robustness
