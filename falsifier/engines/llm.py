"""A language model as a search engine."""

import logging
import re
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

from falsifier.core.candidate import Candidate
from falsifier.core.words import in_one_line
from falsifier.engines.protocol import Engine
from falsifier.engines.random_change import random_change
from falsifier.engines.stand_ins import RANDOM_CHANGE, StandIns
from falsifier.engines.told import doubts_told, reply_form, told_context, told_view
from falsifier.errors import ChatError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, start_values
from falsifier.llm import ReplyKind
from falsifier.llm.conversation import NoValidReplyError, OnExchange, RejectedReplyError, converse
from falsifier.llm.messages import Chat, ChatRequest, Exchange
from falsifier.llm.prompts import DEFAULT_PROMPT_TOKENS, Questions, Variant, View
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.prompts.published import as_point
from falsifier.llm.replies import Answer
from falsifier.llm.tools import MOST_CANDIDATES, PredictionTool, WhatIf, predicted
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict

T = TypeVar("T")
StartValues = Mapping[str, tuple[float, float]]

# Number of latest and best evaluations whose trajectories are kept in memory; prompts show few older samples.
_KEPT_RECENT = 40
_KEPT_BEST = 10
# Questions in a row without a valid answer after which an LLM is not worth its money.
_MOST_WITHOUT_ANSWER = 3
_WORD = re.compile(r"[^\W\d]\w*")
_RANDOM = "random changes of the best sample"
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Advice:
    """Answer to one question of an engine that leads the search.

    Attributes:
        candidates: new ones, at most as many as requested; none if earlier ones are kept.
        foresaw: whether the LLM requested and received predictions before it answered.
        kept: earlier candidates on which it insists, although their predictions are poor.
    """

    candidates: list[Candidate]
    foresaw: bool = False
    kept: list[Candidate] = field(default_factory=list)


class LLMEngine:
    """Asks a language model for the next candidates.

    Args:
        view: the problem without its model.
        chat: the chat with the LLM.
        variant: the prompt variant, which determines what prompts contain.
        reply: what replies consist of; with ``points`` control points stay as the spec has them.
        on_exchange: called with every exchange until ``attach`` replaces it.
        sample: number that distinguishes runs with equal questions, so that cached replies are not shared.
        prompt_tokens: maximum number of tokens of a prompt, estimated.
        anonymous: whether the LLM gets neutral names instead of real ones.
        fallback: engine to switch to if the LLM cannot be reached or gives no valid reply; None: the error
            ends the run.
        start: called once, before the first question, for the smallest and largest value of each output at
            time 0; only if the variant tells them, or if scales depend on them.
    """

    def __init__(
        self,
        view: View,
        chat: Chat,
        variant: Variant,
        *,
        reply: ReplyKind = "json",
        on_exchange: OnExchange = lambda _: None,
        sample: int = 0,
        prompt_tokens: int = DEFAULT_PROMPT_TOKENS,
        anonymous: bool = False,
        fallback: Engine | None = None,
        start: Callable[[], StartValues] = dict,
    ) -> None:
        view = told_view(view, reply)
        self._reply = reply
        self._disguise = Disguise.of(view) if anonymous else None
        self._view = self._disguise.view if self._disguise else view
        self._chat = chat
        self._variant = variant
        self._on_exchange = on_exchange
        self._sample = sample
        self._prompt_tokens = prompt_tokens
        self._fallback = fallback
        self._handed_over = False
        self._stand_ins = StandIns()
        self._pending: list[Candidate] = []
        self._start = start
        self._questions: Questions | None = None
        self._untold: list[Evaluation] = []
        self._samples: dict[Hashable, int] = {}
        self._best: Evaluation | None = None
        self._simulations: int | None = None
        self._doubts: dict[Hashable, str] = {}
        self._rationales: dict[Hashable, str] = {}
        self._lessons = ""
        self._told = self._without_answer = 0

    @property
    def name(self) -> str:
        """Name of the LLM and of the prompt variant, the origin of its candidates."""
        return f"{self._chat.llm} {self._variant.name}"

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Report exchanges to a run, and use its wrapper around this engine's chat from now on."""
        self._on_exchange = on_exchange
        self._chat = wrap(self._chat)

    def begin(self, simulations: int | None) -> None:
        """Be told the maximum number of simulations of the run, which prompts state."""
        self._simulations = simulations

    def doubt(self, confirmation: Confirmation) -> None:
        """Be told that a violation does not count, which prompts state with the reason."""
        self._doubts |= doubts_told([confirmation], self._disguise)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return how many samples are not the LLM's, and why."""
        return self._stand_ins.remarks(evaluations)

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n new candidates.

        Raises:
            ChatError: if there is no fallback, and the LLM cannot be reached or gave no valid reply to
                several questions in a row; after a single one a random change of the best sample is returned.
        """
        candidates: list[Candidate] = []
        while len(candidates) < n:
            if self._handed_over and self._fallback is not None:
                rest = self._fallback.ask(n - len(candidates))
                self._stand_ins.proposed(_engine_named(self._fallback), rest)
                return candidates + rest
            try:
                found, _ = self._asked(n - len(candidates), dispensable=self._fallback is not None)
                self._without_answer = 0
            except NoValidReplyError as error:
                found = self._replaced(error)
            except ChatError as error:
                if self._fallback is None:
                    raise
                self._hand_over(error)
                continue
            self._pending += found
            candidates += [self._disguise.revealed(c) for c in found] if self._disguise else found
        return candidates

    def _replaced(self, error: NoValidReplyError) -> list[Candidate]:
        """Return what is simulated in place of an answer; nothing if the fallback takes over.

        Raises:
            NoValidReplyError: if several questions in a row had no valid answer.
        """
        self._without_answer += 1
        if self._fallback is not None:
            self._hand_over(error)
            return []
        if self._without_answer >= _MOST_WITHOUT_ANSWER:
            raise error
        best = None if self._best is None else self._best.candidate
        seed = (self._sample, self._told, len(self._pending))
        what = "a random change of the best sample" if best else "a random sample"
        _LOG.warning("%s. Continuing with %s.", error, what)
        changed = random_change(self._view.space, best, seed=seed)
        if self._disguise:
            changed = self._disguise.canonical(changed)
        rationale = f"{what}, because {self._chat.llm} gave no valid reply"
        replacement = replace(changed, origin=RANDOM_CHANGE, rationale=rationale)
        self._stand_ins.because(_RANDOM, error)
        real = self._disguise.revealed(replacement) if self._disguise else replacement
        self._stand_ins.proposed(_RANDOM, [real])
        return [replacement]

    def _hand_over(self, error: ChatError) -> None:
        """Switch to the fallback for the rest of the run."""
        assert self._fallback is not None
        self._handed_over = True
        self._stand_ins.because(_engine_named(self._fallback), error)
        _LOG.warning("%s. Continuing with %s.", error, _engine_named(self._fallback))

    def propose(
        self,
        count: int,
        notes: Sequence[str] = (),
        *,
        what_if: WhatIf | None = None,
        predicted: Sequence[Candidate] = (),
        dispensable: bool = False,
    ) -> Advice:
        """Ask one question of an engine that leads the search.

        Args:
            count: maximum number of candidates.
            notes: lines to add to the question, after problem and history.
            what_if: permission to request predictions before answering; ignored if the LLM does not support
                tools.
            predicted: earlier candidates whose predictions are among the notes, and on which the LLM may
                insist.
            dispensable: whether the search continues without an answer. A missing answer is then recorded, so
                that a resumed run continues in the same way.

        Raises:
            ChatError: if the LLM cannot be reached or gives no valid reply.
        """
        tool = None if what_if is None else self._tool(what_if)
        earlier = [self._disguise.hidden_candidate(c) if self._disguise else c for c in predicted]
        found, kept = self._asked(count, notes, tool, earlier, dispensable=dispensable)
        self._pending += found
        revealed = [self._disguise.revealed(c) for c in found] if self._disguise else found
        foresaw = tool is not None and tool.answered > 0
        return Advice(revealed, foresaw=foresaw, kept=[predicted[n] for n in kept])

    def describe(self, candidate: Candidate) -> str:
        """Return a candidate in one line; as a point if the prompt variant shows no names."""
        shown = self._disguise.hidden_candidate(candidate) if self._disguise else candidate
        if not self._variant.has("names") or (self._variant.is_published and self._reply == "points"):
            return "; ".join(as_point(self._view, shown))
        return in_one_line(shown)

    def told(self, reason: str) -> str:
        """Return a reason as the LLM may read it; empty if it has a name that the variant does not show."""
        if self._variant.has("names") and not self._disguise:
            return reason
        hidden = self._disguise or Disguise.of(self._view)
        words = set(_WORD.findall(reason))
        return "" if any(words.intersection(_WORD.findall(name)) for name in hidden.names) else reason

    def foretold(self, verdict: Verdict) -> str:
        """Return a predicted verdict in words, limited to what the variant shows of samples."""
        hidden = self._disguise.hidden_verdict(verdict) if self._disguise else verdict
        return predicted(self._variant, hidden)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add evaluations to the history, including those of other engines' candidates."""
        if self._fallback is not None:
            self._fallback.tell(evaluations)
        told = evaluations
        if self._disguise:
            self._begun()  # first: values at time 0 determine scales before trajectories do
            self._disguise = self._disguise.fitted(evaluations)
            self._view = self._disguise.view
            told = [self._disguise.hidden(e) for e in evaluations]
        for evaluation in told:
            self._told += 1
            self._samples[evaluation.candidate.key] = self._told
            best = None if self._best is None else self._best.robustness
            if evaluation.robustness is not None and (best is None or evaluation.robustness < best):
                self._best = replace(evaluation, trajectory=None)
        self._pending = [c for c in self._pending if c.key not in self._samples]
        # What is told of a sample takes longer than some simulations; it is made when a question needs it.
        self._untold = _thinned([*self._untold, *told])

    def _begun(self) -> Questions:
        """The questions of this run; made once, because the outputs at time 0 are read for them."""
        if self._questions is None:
            start = self._start() if self._disguise or self._variant.has("circumstances") else {}
            if self._disguise:
                self._disguise = Disguise.of(self._disguise.real, start)
                self._view, start = self._disguise.view, self._disguise.hidden_values(start)
            self._questions = Questions(
                self._view,
                self._variant,
                reply=self._reply,
                start=start,
                tokens=self._prompt_tokens,
                llm=self._chat.llm,
            )
        return self._questions

    def _tool(self, what_if: WhatIf) -> PredictionTool:
        disguise = self._disguise
        return PredictionTool(
            what_if,
            reply_form(self._view, self._variant, self._reply, count=MOST_CANDIDATES, reasoned=False),
            self._variant,
            reveal=disguise.revealed if disguise else _unchanged,
            hide=disguise.hidden_verdict if disguise else _unchanged,
        )

    def _asked(
        self,
        count: int,
        notes: Sequence[str] = (),
        tool: PredictionTool | None = None,
        predicted: Sequence[Candidate] = (),
        *,
        dispensable: bool,
    ) -> tuple[list[Candidate], list[int]]:
        """Ask one question; return new candidates, and places of earlier ones on which the LLM insists."""
        questions = self._begun()
        questions.view = self._view
        for evaluation in self._untold:
            key = evaluation.candidate.key
            questions.tell(evaluation, doubt=self._doubts.get(key, ""), why=self._rationales.get(key, ""))
        self._untold.clear()
        keys = [c.key for c in predicted]
        form = reply_form(self._view, self._variant, self._reply, count=count, keepable=len(predicted))
        request = ChatRequest(
            messages=questions.ask(
                count,
                simulations=self._simulations,
                # Of those with predictions, the notes say what is known.
                pending=[c for c in self._pending if c.key not in keys],
                notes=notes,
                lessons=self._lessons,
            ),
            reply_schema=None if form.points else form.schema(),
            tools=() if tool is None else (tool.offer,),
            sample=self._sample,
        )

        def read(text: str) -> tuple[list[Candidate], list[int]]:
            answer = form.read(text, origin=self.name)
            new, kept = self._sorted_out(answer, keys)
            self._lessons = answer.lessons or self._lessons
            return new[:count], kept

        try:
            found, kept = converse(
                self._chat,
                request,
                read,
                self._on_exchange,
                respond=None if tool is None else tool.respond,
            )
        except NoValidReplyError:
            raise
        except ChatError as error:
            if dispensable:  # recorded, so that a resumed run continues without an answer at the same point
                self._on_exchange(_unanswered(self._chat, request, error))
            raise
        self._rationales |= {c.key: c.rationale for c in found}
        return found, kept

    def _sorted_out(self, answer: Answer, predicted: Sequence[Hashable]) -> tuple[list[Candidate], list[int]]:
        """Return the new candidates of an answer, and the places of predicted ones that it keeps or repeats.

        Raises:
            RejectedReplyError: if there is none of either.
        """
        candidates = list(answer.candidates)
        if self._disguise:
            candidates = [self._disguise.canonical(c) for c in candidates]
        kept = {n - 1 for n in answer.kept} | {
            predicted.index(c.key) for c in candidates if c.key in predicted
        }
        seen: dict[Hashable, str] = {key: f"sample {number}" for key, number in self._samples.items()}
        seen |= {c.key: "one that was proposed already" for c in self._pending}
        new = {c.key: c for c in candidates if c.key not in seen}
        if not new and not kept:
            # The published prompts number only the samples that they show.
            which = "an earlier sample" if self._variant.is_published else seen[candidates[0].key]
            raise RejectedReplyError(f"it repeats {which}")
        return list(new.values()), sorted(kept)


def make_llm_engine(
    problem: Problem,
    chat: Chat,
    *,
    variant: str | None = None,
    reply: ReplyKind = "json",
    on_exchange: OnExchange = lambda _: None,
    sample: int = 0,
    prompt_tokens: int = DEFAULT_PROMPT_TOKENS,
    anonymous: bool = False,
    fallback: Engine | None = None,
) -> LLMEngine:
    """Create the engine for a problem; for the arguments see LLMEngine.

    Args:
        problem: the problem to search.
        chat: the chat with the LLM.
        variant: name of the prompt variant; None: the default one.
        reply: what replies consist of.
        on_exchange: called with every exchange until ``attach`` replaces it.
        sample: number that distinguishes runs with equal questions.
        prompt_tokens: maximum number of tokens of a prompt, estimated.
        anonymous: whether the LLM gets neutral names instead of real ones.
        fallback: engine to switch to if the LLM fails.

    Raises:
        SpecError: if the variant is unknown, or context cannot be read or is to be sent anonymously.
    """
    problem, told = told_context(problem, variant, anonymous=anonymous)
    return LLMEngine(
        View.of(problem),
        chat,
        told,
        reply=reply,
        on_exchange=on_exchange,
        sample=sample,
        prompt_tokens=prompt_tokens,
        anonymous=anonymous,
        fallback=fallback,
        start=partial(start_values, problem),
    )


def _engine_named(engine: Engine) -> str:
    return f"the engine {engine.name!r}"


def _unchanged(value: T) -> T:
    return value


def _unanswered(chat: Chat, request: ChatRequest, error: ChatError) -> Exchange:
    return Exchange(
        llm=chat.llm,
        messages=request.messages,
        parameters=dict(chat.parameters),
        reply=None,
        lost=error.lost,
        problem=str(error),
    )


def _thinned(evaluations: list[Evaluation]) -> list[Evaluation]:
    """Return the same evaluations without the trajectories that no prompt will show."""
    if len(evaluations) <= _KEPT_RECENT:
        return evaluations
    judged = sorted((e.robustness, i) for i, e in enumerate(evaluations) if e.robustness is not None)
    kept = {i for _, i in judged[:_KEPT_BEST]} | set(range(len(evaluations) - _KEPT_RECENT, len(evaluations)))
    return [
        e if i in kept or e.trajectory is None else replace(e, trajectory=None)
        for i, e in enumerate(evaluations)
    ]
