"""A language model as a search engine."""

import logging
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from textwrap import shorten

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted
from falsifier.engines.briefing import Briefing
from falsifier.engines.layout import fixed_layout
from falsifier.engines.protocol import RANDOM_CHANGE
from falsifier.errors import ChatError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.candidate_text import lessons_in
from falsifier.llm.conversation import NoValidReplyError, OnExchange, RejectedReplyError, converse
from falsifier.llm.messages import Chat, ChatRequest, Exchange
from falsifier.problem.problem import Problem

# Questions in a row without a valid answer after which an LLM is not worth its money.
_MOST_WITHOUT_ANSWER = 3
# Characters of a reason in a remark: rejected replies are quoted in it, after what is wrong.
_LONGEST_REASON = 240
# Of a random change: share of the numbers that change, and its standard deviation as a share of the range.
_SHARE = 0.3
_DEVIATION = 0.25
_LOG = logging.getLogger(__name__)


class LLMEngine:
    """Asks a language model (LLM) for the next candidates.

    Args:
        problem: the problem to search.
        chat: the chat with the LLM.
        variant: name of the prompt variant, which determines what prompts contain; None: the default one.
        sample: number that distinguishes runs with equal questions, so that cached replies are not shared.
        anonymous: whether the LLM gets neutral names instead of real ones.

    Attributes:
        briefing: what the LLM is told.

    Raises:
        SpecError: if the variant is unknown, or context cannot be read or is to be sent anonymously.
    """

    def __init__(
        self,
        problem: Problem,
        chat: Chat,
        *,
        variant: str | None = None,
        sample: int = 0,
        anonymous: bool = False,
    ) -> None:
        self.briefing = Briefing(problem, variant=variant, anonymous=anonymous, llm=chat.llm)
        self._chat = chat
        self._on_exchange: OnExchange = lambda _: None
        self._sample = sample
        self._without_answer = 0
        # Where samples in place of an answer are from, and why the first of them was needed.
        self._instead_of: dict[Hashable, str] = {}
        self._reason = ""

    @property
    def name(self) -> str:
        """Name of the LLM and of the prompt variant, the origin of its candidates."""
        return f"{self._chat.llm} {self.briefing.variant.name}"

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Report exchanges to a run, and use its wrapper around this engine's chat from now on."""
        self._on_exchange = on_exchange
        self._chat = wrap(self._chat)

    def begin(self, simulations: int | None) -> None:
        """Be told the maximum number of simulations of the run, which prompts state."""
        self.briefing.simulations = simulations

    def doubt(self, confirmation: Confirmation) -> None:
        """Be told that a violation does not count, which prompts state with the reason."""
        self.briefing.doubt(confirmation)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return how many samples are not the LLM's, and why."""
        found = (self._instead_of.get(e.candidate.key) for e in evaluations)
        if not (counts := Counter(filter(None, found))):
            return ()
        told = " and ".join(f"{count} {where}" for where, count in counts.items())
        return (f"of {counted(len(evaluations), 'sample')}, {told}, because {self._reason}",)

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n new candidates.

        Raises:
            ChatError: if the LLM cannot be reached, or gave no valid reply to several questions in a row;
                after a single one a random change of the best sample, or without one a random sample, is
                returned.
        """
        candidates: list[Candidate] = []
        while len(candidates) < n:
            try:
                candidates += self.propose(n - len(candidates))
                self._without_answer = 0
            except NoValidReplyError as error:
                self._without_answer += 1
                if self._without_answer >= _MOST_WITHOUT_ANSWER:
                    raise
                candidates.append(self._instead(error))
        return candidates

    def propose(self, count: int, notes: Sequence[str] = (), *, dispensable: bool = False) -> list[Candidate]:
        """Ask one question of an engine that leads the search; return new candidates, at least one.

        Args:
            count: maximum number of candidates.
            notes: lines to add to the question, after problem and history.
            dispensable: whether the search continues without an answer. A missing answer is then recorded, so
                that a resumed run continues in the same way.

        Raises:
            ChatError: if the LLM cannot be reached or gives no valid reply.
        """
        briefing = self.briefing
        messages = briefing.question(count, notes)
        form = briefing.form(count)
        request = ChatRequest(messages=messages, reply_schema=form.schema(), sample=self._sample)

        def read(text: str) -> list[Candidate]:
            new = self._new(form.read(text, origin=self.name))
            if form.lessons:
                briefing.lessons = lessons_in(text) or briefing.lessons
            return new[:count]

        try:
            found = converse(self._chat, request, read, self._on_exchange)
        except ChatError as error:
            if dispensable and not isinstance(error, NoValidReplyError):  # whose replies are recorded
                lost = Exchange(
                    llm=self._chat.llm, messages=messages, reply=None, lost=error.lost, problem=str(error)
                )
                self._on_exchange(lost)
            raise
        briefing.rationales |= {c.key: c.rationale for c in found}
        briefing.pending += found
        return [briefing.revealed(c) for c in found]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add evaluations to the history, including those of other engines' candidates."""
        self.briefing.tell(evaluations)

    def _instead(self, error: NoValidReplyError) -> Candidate:
        """Return what is simulated in place of an answer."""
        briefing = self.briefing
        seed = (self._sample, len(briefing.samples), len(briefing.pending))
        changed = random_change(briefing.view.space, briefing.best, seed=seed)
        what = "a random change of the best sample" if briefing.best else "a random sample"
        rationale = f"{what}, because {self._chat.llm} gave no valid reply"
        changed = replace(changed, origin=RANDOM_CHANGE, rationale=rationale)
        briefing.pending.append(changed)
        real = briefing.revealed(changed)
        _LOG.warning("%s. Continuing with %s.", error, what)
        self._reason = self._reason or reason_in_remark(str(error))
        where = "from random changes of the best sample" if briefing.best else "drawn at random"
        self._instead_of[real.key] = where
        return real

    def _new(self, proposed: Sequence[Candidate]) -> list[Candidate]:
        """Return the new ones of the proposed candidates; RejectedReplyError if there is none."""
        briefing = self.briefing
        seen: dict[Hashable, str] = {key: briefing.called(n) for key, n in briefing.numbers.items()}
        seen |= {c.key: "one that was proposed already" for c in briefing.pending}
        new = {c.key: c for c in proposed if c.key not in seen}
        if not new:
            raise RejectedReplyError(f"it repeats {seen[proposed[0].key]}")
        return list(new.values())


def reason_in_remark(reason: str) -> str:
    """Return why an answer was missing, in one line and not too long."""
    return shorten(reason, _LONGEST_REASON, placeholder=" ...")


def random_change(space: SearchSpace, best: Candidate | None, *, seed: tuple[int, ...]) -> Candidate:
    """Return a random change of a candidate in at least one number; without one, any point of the space."""
    rng, box = np.random.default_rng(seed), fixed_layout(space)
    if best is None:
        return box.candidate(rng.random(box.dimension), origin="", rationale="")
    changed = rng.random(box.dimension) < _SHARE
    changed[rng.integers(box.dimension)] = True
    noise = np.where(changed, rng.normal(0.0, _DEVIATION, box.dimension), 0.0)
    old = box.point(best)
    is_inside = (old + noise >= 0.0) & (old + noise <= 1.0)
    # A step across a limit is taken the other way, or a number at its limit would often not change at all.
    return box.candidate(np.where(is_inside, old + noise, old - noise), origin="", rationale="")
