"""A language model as a search engine."""

from collections.abc import Sequence

from falsifier.evaluation import Evaluation
from falsifier.llm.conversation import OnExchange, RejectedReply, converse
from falsifier.llm.messages import Chat, ChatRequest, Message
from falsifier.llm.prompts import Variant, View, build_prompt, render, variant_named
from falsifier.llm.replies import ReplyForm
from falsifier.problem import Problem
from falsifier.space import Candidate


class LLMProposer:
    """Asks a language model for the next candidates.

    Args:
        view: the problem, without what simulates it.
        chat: the model.
        variant: what its prompts tell.
        on_exchange: called with every question and answer.
        sample: which of several runs with equal questions this is.
    """

    def __init__(
        self,
        view: View,
        chat: Chat,
        variant: Variant,
        *,
        on_exchange: OnExchange = lambda _: None,
        sample: int = 0,
    ) -> None:
        self._view = view
        self._chat = chat
        self._variant = variant
        self._on_exchange = on_exchange
        self._sample = sample
        self._evaluations: list[Evaluation] = []
        self._pending: list[Candidate] = []

    @property
    def name(self) -> str:
        """Model and prompt variant."""
        return f"{self._chat.model} {self._variant.name}"

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n new candidates.

        Raises:
            ChatError: when the model cannot be reached or gives no valid reply.
        """
        candidates: list[Candidate] = []
        while len(candidates) < n:
            found = self._ask_once(n - len(candidates))
            candidates += found
            self._pending += found
        return candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add evaluations to the history, whoever proposed their candidates."""
        self._evaluations += evaluations
        told = {e.candidate.key for e in evaluations}
        self._pending = [c for c in self._pending if c.key not in told]

    def _ask_once(self, count: int) -> list[Candidate]:
        view, variant = self._view, self._variant
        form = ReplyForm(view.space, named=variant.has("names"), free=variant.has("freedom"), count=count)
        request = ChatRequest(
            messages=render(
                build_prompt(view, variant, self._evaluations, pending=self._pending, count=count)
            ),
            reply_schema=form.schema(),
            sample=self._sample,
        )
        return converse(
            self._chat,
            request,
            lambda text: self._new(form.read(text, origin=self.name))[:count],
            self._on_exchange,
        )

    def _new(self, candidates: list[Candidate]) -> list[Candidate]:
        """Candidates that were not seen before.

        Raises:
            RejectedReply: when there is none.
        """
        seen = {e.candidate.key: f"sample {i}" for i, e in enumerate(self._evaluations, start=1)}
        seen |= {c.key: "one that was proposed already" for c in self._pending}
        repeated = ""
        new: dict[tuple[object, ...], Candidate] = {}
        for candidate in candidates:
            if candidate.key in seen:
                repeated = seen[candidate.key]
            else:
                new.setdefault(candidate.key, candidate)
        if not new:
            raise RejectedReply(f"it repeats {repeated}")
        return list(new.values())


def make_llm_proposer(
    problem: Problem,
    chat: Chat,
    *,
    variant: str | None = None,
    on_exchange: OnExchange = lambda _: None,
    sample: int = 0,
) -> LLMProposer:
    """Make the proposer for a problem; variant None means the default one.

    Raises:
        SpecError: for an unknown variant.
    """
    return LLMProposer(View.of(problem), chat, variant_named(variant), on_exchange=on_exchange, sample=sample)


def preview(
    problem: Problem, *, variant: str | None = None, evaluations: Sequence[Evaluation] = (), count: int = 1
) -> tuple[Message, ...]:
    """Messages that would be sent next; sends nothing."""
    return render(build_prompt(View.of(problem), variant_named(variant), evaluations, count=count))
