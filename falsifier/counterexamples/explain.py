"""Why a counterexample violates, or a near miss does not: what decided it, and which inputs matter.

The monitor provides the path from the formula to the deciding predicate. Ablation shows which inputs matter:
each signal, each of its stretches and each parameter is reset to rest, one at a time, and the model is
simulated again.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from falsifier.core.arguments import instance
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import InputRange, ParameterRange
from falsifier.core.words import candidate_lines
from falsifier.counterexamples.shrink import constant_signal, stretches, with_signal
from falsifier.counterexamples.simplicity import rest_value
from falsifier.evaluation.evaluate import Evaluation, evaluate, monitor_for
from falsifier.problem.problem import Problem
from falsifier.stl import Diagnosis, in_words
from falsifier.stl.margins import is_on_limit, margin_words, shown, signed

if TYPE_CHECKING:
    from falsifier.llm.messages import Chat

_NARRATOR = (
    "You explain to a control engineer {what}. Describe in one short paragraph of plain text what happens "
    "over time and which inputs cause it. Use only the information given, and mark assumptions as such."
)
_VIOLATES = "why a simulated system violates a requirement"
_HOLDS = "how near a simulated system comes to violating a requirement, which it does not violate"
# Rows of the trajectory shown to a language model, in addition to the critical one.
_ROWS = 21
# Maximum number of stretches of one signal that are reset one at a time; the longest are chosen.
_MAX_STRETCHES = 12


@dataclass(frozen=True, slots=True)
class Effect:
    """What happens if one part of a counterexample is reset.

    Attributes:
        name: name of the input or parameter.
        span: start and end in s of the reset part; None for a parameter or a whole signal.
        instead: the value it was reset to.
        is_rest: whether that is the rest value; otherwise it is the middle of the range.
        was_rest: whether the part was already at rest in the counterexample.
        robustness: robustness after the reset; None if the simulation failed.
    """

    name: str
    span: tuple[float, float] | None
    instead: float
    is_rest: bool
    was_rest: bool
    robustness: float | None

    @property
    def needed(self) -> bool:
        """Whether the violation disappears without this part."""
        return self.robustness is not None and self.robustness >= 0

    @property
    def told(self) -> str:
        """The robustness as it is shown."""
        return signed(self.robustness, 4)


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a counterexample violates, or how near a simulation comes to it.

    Attributes:
        problem: the problem with the requirement.
        evaluation: the counterexample, or the nearest miss.
        diagnosis: the path from the formula to the deciding predicate.
        effects: effects of resetting parts: whole signals and parameters, then stretches.
    """

    problem: Problem
    evaluation: Evaluation
    diagnosis: Diagnosis
    effects: tuple[Effect, ...]

    @property
    def text(self) -> str:
        """The explanation in one paragraph."""
        requirement = self.problem.requirement
        demand = requirement.description or in_words(requirement.formula)
        robustness = self.diagnosis.robustness
        named = "robustness, the margin by which it holds"
        if is_on_limit(robustness):
            meaning = margin_words(robustness, str(self.diagnosis.path[-1].formula))
            found = f"It {'is ' if self.violated else ''}{meaning}"
        elif self.violated:
            found = f"It is violated by {-robustness:.5g} ({named}: {robustness:+.5g})"
        else:
            found = f"It is not violated here; {robustness:.5g} is missing to a violation ({named})"
        sentences = [
            f"{self.problem.name} requires: {demand.rstrip('.')}.",
            f"{found}: {self.diagnosis.plain}",
            *(self._effect_sentences() if self.violated else self._miss_sentences()),
        ]
        return " ".join(sentences)

    @property
    def violated(self) -> bool:
        """Whether the requirement is violated; otherwise the simulation is a near miss."""
        return self.diagnosis.robustness < 0

    def _miss_sentences(self) -> Iterator[str]:
        """What brings the simulation near a violation, strongest first, then what does not."""
        here = self.diagnosis.robustness
        whole = [e for e in self.effects if e.span is None]
        for e in sorted(whole, key=lambda e: -inf if e.robustness is None else -e.robustness):
            part, instead = self._part(e), self._instead(e)
            if e.robustness is None:
                yield f"With {e.name} {instead} the simulation fails."
            elif e.robustness < 0:
                yield (
                    f"With {e.name} {instead} the requirement would be violated by "
                    f"{-shown(e.robustness):.4g}, which is not confirmed yet."
                )
            elif e.robustness > here:
                yield f"{part} brings it near: {instead} robustness would be {e.told}."
            elif e.robustness == here:
                yield f"{part} makes no difference: {instead} robustness would be the same."
            else:
                yield f"{part} keeps it away: {instead} robustness would be {e.told}, nearer."
        for name in dict.fromkeys(e.name for e in whole if (e.robustness or 0.0) > here):
            spans = [e for e in self.effects if e.name == name and e.span is not None]
            yield from map(self._stretch, sorted(spans, key=lambda e: -(e.robustness or 0.0))[:1])

    def _effect_sentences(self) -> Iterator[str]:
        whole = [e for e in self.effects if e.span is None]
        needed = sorted((e for e in whole if e.needed), key=lambda e: -(e.robustness or 0.0))
        for e in needed:
            yield f"{self._part(e)} is necessary: {self._instead(e)} robustness would be {e.told}."
        for e in whole:
            if e.robustness is not None and not e.needed:
                part, instead = self._part(e), self._instead(e)
                yield f"{part} is not necessary: {instead} robustness would still be {e.told}."
        for name in dict.fromkeys(e.name for e in needed):
            spans = [e for e in self.effects if e.name == name and e.span is not None]
            decisive = [e for e in spans if e.needed]
            if len(decisive) < len(spans):  # otherwise the whole signal matters, as stated already
                yield from map(self._stretch, decisive)
        for e in whole:
            if e.robustness is None:
                yield f"With {e.name} {self._instead(e)} the simulation fails."

    def _part(self, effect: Effect) -> str:
        """The part at the start of a sentence."""
        part = _capitalized(effect.name)
        return f"{part} {self._rest(effect)}" if effect.was_rest else part

    def _stretch(self, effect: Effect) -> str:
        start, end = effect.span or (0.0, 0.0)
        return (
            f"{_capitalized(effect.name)} is decisive from {start:.4g} to {end:.4g} s: "
            f"{self._instead(effect)} during that time robustness would be {effect.told}."
        )

    def _instead(self, effect: Effect) -> str:
        unit = next((v.unit for v in self.problem.info.variables if v.name == effect.name), "")
        number = f"{effect.instead:.4g}" + (f" {unit}" if unit not in ("", "1") else "")
        return f"{self._rest(effect) if effect.is_rest else 'at the middle of its range'} ({number})"

    def _rest(self, effect: Effect) -> str:
        is_parameter = any(p.name == effect.name for p in self.problem.space.parameters)
        return "at its nominal value" if is_parameter else "at rest"


def explain(problem: Problem, evaluation: Evaluation) -> Explanation:
    """Diagnose a counterexample, or a near miss, and reset its parts one at a time.

    Raises:
        SpecError: if no evaluation is given.
        ValueError: if the evaluation has no trajectory.
    """
    instance("explain", evaluation, Evaluation, "an evaluation, such as confirmation.evaluation")
    if evaluation.trajectory is None:
        raise ValueError("a failed simulation cannot be explained: pass an evaluation with a trajectory")
    diagnosis = monitor_for(problem).diagnose(evaluation.trajectory)
    effects = tuple(_effects(problem, evaluation.candidate))
    return Explanation(problem, evaluation, diagnosis, effects)


def narrate(explanation: Explanation, chat: "Chat") -> str:
    """Let a language model describe what happens, given only the findings and the trajectory.

    Raises:
        ChatError: if the LLM gives no reply.
    """
    from falsifier.llm.conversation import converse
    from falsifier.llm.messages import ChatRequest, Message

    messages = (
        Message(role="system", content=_NARRATOR.format(what=_VIOLATES if explanation.violated else _HOLDS)),
        Message(role="user", content=_findings(explanation)),
    )
    return converse(chat, ChatRequest(messages=messages), str.strip, lambda exchange: None)


def _findings(explanation: Explanation) -> str:
    """The text for the language model: system, findings, inputs and a few rows of the trajectory."""
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
    """The value that an input or parameter is reset to."""

    name: str
    value: float
    is_rest: bool
    was_rest: bool

    def effect(self, span: tuple[float, float] | None, robustness: float | None) -> Effect:
        return Effect(self.name, span, self.value, self.is_rest, self.was_rest, robustness)


def _nominal(problem: Problem, ranged: InputRange | ParameterRange, values: tuple[float, ...]) -> _Nominal:
    """Rest, or the middle of the range if rest is unknown or all values are at rest already."""
    rest = rest_value(problem, ranged.name)
    was_rest = rest is not None and all(v == rest for v in values)
    if rest is not None and not was_rest:
        return _Nominal(ranged.name, rest, is_rest=True, was_rest=False)
    return _Nominal(ranged.name, (ranged.low + ranged.high) / 2, is_rest=False, was_rest=was_rest)


def _longest(signal: Signal) -> list[tuple[int, int]]:
    """The longest stretches of equal values, in time order; none for a constant signal."""
    found = stretches(signal.values)
    if len(found) < 2:
        return []
    return sorted(sorted(found, key=lambda s: s[0] - s[1])[:_MAX_STRETCHES])


def _span(signal: Signal, first: int, end: int, stop_time: float) -> tuple[float, float]:
    """Interval in s that control points influence: between the unchanged neighbours, or to the next step."""
    finish = signal.times[end] if end < len(signal.times) else stop_time
    if signal.interpolation == "constant":
        return signal.times[first], finish
    return signal.times[max(first - 1, 0)], finish


def _capitalized(name: str) -> str:
    """Name at the start of a sentence; only plain words are capitalized: ``u`` is not ``U``."""
    return name.capitalize() if len(name) > 1 and name.isalpha() and name.islower() else name


def _robustness(problem: Problem, candidate: Candidate) -> float | None:
    return evaluate(problem, problem.space.admit(candidate)).robustness
