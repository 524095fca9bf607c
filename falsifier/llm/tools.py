"""What an LLM may call before it answers: predictions of candidates, without a simulation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.messages import Tool, ToolCall
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.what_if import NAME, answer, predicted, what_if_tool
from falsifier.llm.replies import ReplyForm
from falsifier.stl import Verdict

# Candidates of one call that are predicted; an answer about more would cost tokens and be skimmed.
MOST_CANDIDATES = 10


class Predictor(Protocol):
    """Foretells verdicts without a simulation."""

    @property
    def recent_error(self) -> float:
        """Root mean square error of recent predictions, as a share of the spread of what was predicted."""
        ...

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        """Return the predicted verdict of each candidate, in the requirement's own unit."""
        ...


@dataclass(frozen=True, slots=True)
class WhatIf:
    """Leave to ask for predictions during one turn.

    Attributes:
        predictor: whom to ask.
        calls: how many calls are answered.
    """

    predictor: Predictor
    calls: int


@dataclass
class PredictionTool:
    """Answers the calls of one turn.

    Attributes:
        what_if: whom to ask, and how often.
        form: of the candidates that are asked about.
        variant: what is told.
        reveal: from a candidate as the LLM writes it to the real one.
        hide: from a real verdict to one that the LLM may know.
        answered: how many calls were answered.
    """

    what_if: WhatIf
    form: ReplyForm
    variant: Variant
    reveal: Callable[[Candidate], Candidate]
    hide: Callable[[Verdict], Verdict]
    answered: int = field(default=0, init=False)

    @property
    def offer(self) -> Tool:
        """What the LLM is told of it."""
        return what_if_tool(self.form.schema(), calls=self.what_if.calls)

    def respond(self, call: ToolCall) -> str:
        """Answer one call.

        Raises:
            RejectedReplyError: telling what is wrong with it, or that the limit is reached.
        """
        if call.name != NAME:
            raise RejectedReplyError(f"there is no tool {call.name!r}, only {NAME!r}")
        if self.answered >= self.what_if.calls:
            raise RejectedReplyError(
                f"the limit of {self.what_if.calls} calls is reached; reply with your candidates now"
            )
        found = self.form.read_each(call.arguments)
        if all(isinstance(one, RejectedReplyError) for one in found):
            raise RejectedReplyError(f"the arguments are wrong: {found[0]}")
        self.answered += 1
        lines = self._lines(found[:MOST_CANDIDATES])
        if len(found) > MOST_CANDIDATES:
            lines.append(f"and {len(found) - MOST_CANDIDATES} more: not predicted, ask about fewer at a time")
        left = self.what_if.calls - self.answered
        return answer(lines, error=self.what_if.predictor.recent_error, left=left)

    def _lines(self, found: Sequence[Candidate | RejectedReplyError]) -> list[str]:
        valid = [self.reveal(one) for one in found if isinstance(one, Candidate)]
        verdicts = iter(self.what_if.predictor.foresee(valid) if valid else ())
        return [
            predicted(self.variant, self.hide(next(verdicts)))
            if isinstance(one, Candidate)
            else f"not predicted: {one}"
            for one in found
        ]
