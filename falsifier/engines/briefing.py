"""What a language model is told of a search, and the form of its answers; ``preview`` shows it unasked."""

import re
from collections.abc import Hashable, Sequence
from functools import cached_property

from falsifier.context.values import NOTHING
from falsifier.core.candidate import Candidate
from falsifier.core.words import in_one_line
from falsifier.errors import SpecError, setting, written
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, readable_internals, start_values
from falsifier.llm import CONTEXT_VARIANT
from falsifier.llm.messages import Message
from falsifier.llm.prompts import Questions, Variant, View, variant_named
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.prompts.numbers import number
from falsifier.llm.prompts.published import as_point
from falsifier.llm.replies import ReplyForm
from falsifier.problem.context import with_context
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.stl.margins import signed

_WORD = re.compile(r"[^\W\d]\w*")


class Briefing:
    """What a language model (LLM) knows of a search. It never gets the model.

    Candidates and samples are kept as they are told: with neutral names if it is anonymous.

    For the arguments see ``LLMEngine``.

    Attributes:
        simulations: maximum number of simulations of the run, which prompts state; None: no limit.
        lessons: what the LLM wrote down for its next question.
        numbers: numbers of the samples, by the keys of their candidates.
        samples: candidates of the samples, in order.
        best: candidate of the sample with the smallest robustness.
        pending: candidates that were proposed and have no evaluation yet.
        rationales: the LLM's reasons, by the keys of its candidates.

    Raises:
        SpecError: if the variant is unknown, or context cannot be read or is to be sent anonymously.
    """

    def __init__(
        self, problem: Problem, *, variant: str | None = None, anonymous: bool = False, llm: str = ""
    ) -> None:
        self._problem, self.variant = told_context(problem, variant, anonymous=anonymous)
        self._view = View.of(self._problem)
        self._disguise = Disguise.of(self._view) if anonymous else None
        self._llm = llm
        self._doubts: dict[Hashable, str] = {}
        self._smallest = float("inf")
        self.simulations: int | None = None
        self.lessons = ""
        self.numbers: dict[Hashable, int] = {}
        self.best: Candidate | None = None
        self.pending: list[Candidate] = []
        self.rationales: dict[Hashable, str] = {}
        self.samples: list[Candidate] = []

    @property
    def view(self) -> View:
        """The problem as it is told."""
        return self._disguise.view if self._disguise else self._view

    def hidden(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it is told."""
        return self._disguise.hidden_candidate(candidate) if self._disguise else candidate

    def revealed(self, candidate: Candidate) -> Candidate:
        """Return a candidate as it can be simulated, from how it is told."""
        return self._disguise.revealed(candidate) if self._disguise else candidate

    def describe(self, candidate: Candidate) -> str:
        """Return a candidate in one line; as a point if the prompt variant shows no names."""
        told = self.hidden(candidate)
        return in_one_line(told) if self.variant.has("names") else "; ".join(as_point(self.view, told))

    def called(self, number: int) -> str:
        """Return what a sample is called; the published prompts number only those that they show."""
        return "an earlier sample" if self.variant.is_published else f"sample {number}"

    def reason(self, text: str) -> str:
        """Return a reason as the LLM may read it; empty if it has a name that the variant does not show."""
        if self.variant.has("names") and not self._disguise:
            return text
        hidden = self._disguise or Disguise.of(self._view)
        words = set(_WORD.findall(text))
        return "" if any(words.intersection(_WORD.findall(name)) for name in hidden.names) else text

    def foretold(self, verdict: Verdict) -> str:
        """Return a predicted verdict in words, limited to what the variant shows of samples."""
        verdict = self._disguise.hidden_verdict(verdict) if self._disguise else verdict
        text = f"predicted robustness {signed(verdict.robustness, 3)}"
        if not self.variant.has("critical"):
            return text
        by = f" by {verdict.predicate}" if self.variant.has("requirement") and verdict.predicate else ""
        return f"{text}, decided at about t = {number(verdict.critical_time, 4)} s{by}"

    def form(self, count: int) -> ReplyForm:
        """Return the form of replies with up to ``count`` candidates."""
        space, has = self.view.space, self.variant.has
        offered = space if has("freedom") else space.fixed
        samples = self.samples if self.view.is_long_to_repeat and not self.variant.is_published else None
        return ReplyForm(offered, has("names"), count, has("lessons"), samples)

    def doubt(self, confirmation: Confirmation) -> None:
        """Note that a violation does not count, before its evaluation is told; prompts state the reason."""
        self._doubts[self.hidden(confirmation.candidate).key] = in_doubt(confirmation)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add samples, whoever proposed their candidates."""
        for evaluation in evaluations:
            if self._disguise:
                evaluation = self._disguise.hidden(evaluation)
            key = evaluation.candidate.key
            self.samples.append(evaluation.candidate)
            self.numbers[key] = len(self.samples)
            if evaluation.robustness is not None and evaluation.robustness < self._smallest:
                self._smallest, self.best = evaluation.robustness, evaluation.candidate
            self._questions.tell(
                evaluation, doubt=self._doubts.get(key, ""), why=self.rationales.get(key, "")
            )
        self.pending = [c for c in self.pending if c.key not in self.numbers]

    def question(self, count: int, notes: Sequence[str] = ()) -> tuple[Message, ...]:
        """Return the messages of the next question for up to ``count`` candidates, with the notes in it."""
        return self._questions.ask(
            count, simulations=self.simulations, pending=self.pending, notes=notes, lessons=self.lessons
        )

    @cached_property
    def _questions(self) -> Questions:
        """Made when it is first needed, because the FMU is initialised for the outputs at time 0."""
        start = start_values(self._problem) if self.variant.has("circumstances") else {}
        if self._disguise:
            start = self._disguise.hidden_values(start)
        return Questions(self.view, self.variant, start=start, llm=self._llm)


def told_context(
    problem: Problem, variant: str | None, *, anonymous: bool = False
) -> tuple[Problem, Variant]:
    """Return the problem with the context that is told, if any, and the prompt variant.

    Files are read only here, and only if the variant tells them.

    Raises:
        SpecError: if the variant is unknown, context cannot be read, would be sent anonymously, or was asked
            for although the variant does not tell it.
    """
    named = problem.named_context
    told = variant_named(variant, has_context=bool(named))
    if not named:
        return problem, told
    if not told.has("context"):
        if problem.source is not None and set(problem.source.context) - {NOTHING}:
            raise SpecError(
                f"{setting('context')}: the prompt variant {told.name} does not tell it; use "
                f"{CONTEXT_VARIANT}, or drop {setting('variant')}"
            )
        return problem, told
    if anonymous:
        out = written(f"--context {NOTHING}", f"context=[{NOTHING!r}]")
        raise SpecError(
            f"{setting('anonymous')} hides what the system is, and context would tell it: drop the one, or "
            f"leave the files out with {out}"
        )
    return with_context(problem), told


def preview(
    problem: Problem,
    *,
    variant: str | None = None,
    evaluations: Sequence[Evaluation] = (),
    anonymous: bool = False,
    simulations: int | None = None,
    doubtful: Sequence[Confirmation] = (),
    lessons: str = "",
) -> tuple[Message, ...]:
    """Return the messages that would be sent next, without sending them.

    Args:
        problem: the problem to search.
        variant: name of the prompt variant; None: the default one.
        evaluations: what was simulated so far, in order.
        anonymous: whether the LLM gets neutral names instead of real ones.
        simulations: maximum number of simulations of the run; None: no limit.
        doubtful: violations among the evaluations that do not count.
        lessons: what the LLM wrote down in its last reply.
    """
    told = problem.watching(readable_internals([problem]), only_modes=True)
    briefing = Briefing(told, variant=variant, anonymous=anonymous)
    briefing.simulations = simulations
    briefing.lessons = briefing.reason(lessons)  # those of a run with real names have these
    doubts = {c.candidate.key: c for c in doubtful}
    for evaluation in evaluations:
        candidate = evaluation.candidate
        if candidate.key in doubts:
            briefing.doubt(doubts[candidate.key])
        # A reason with neutral names is not recorded.
        if candidate.origin.endswith(f" {briefing.variant.name}") and not anonymous:
            briefing.rationales[candidate.key] = candidate.rationale
        briefing.tell([evaluation])
    return briefing.question(1)


def in_doubt(confirmation: Confirmation) -> str:
    """Why a violation does not count, without any name, and what would count."""
    found, robustness = confirmation.evaluation.robustness, confirmation.robustness
    halved, reference = confirmation.halved, confirmation.reference
    again: float | None = None
    if robustness is None:
        why = "a second simulation of it failed"
    elif robustness >= 0:
        again, why = robustness, f"a second simulation gave robustness {signed(robustness, 3)}"
    elif halved is not None and halved >= 0:
        again, why = halved, f"at half the simulation step its robustness is {signed(halved, 3)}"
    else:
        why = "a second monitor does not confirm it"
        if reference is not None:
            why += f", {signed(reference, 3)} instead of {signed(robustness, 3)}"
    text = f"this does not count as a violation, it is {confirmation.outcome}: {why}"
    if again is None:
        return text
    assert found is not None, "a violation has a robustness"
    error = f"{again - found:.2g}"
    return f"{text}. Find one that is clearer: below 0 by more than {error}, the error of the simulation"
