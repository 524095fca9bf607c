"""The tool that an LLM may call before it replies: predictions for candidates, without a simulation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.messages import Tool, ToolCall
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.what_if import NAME, answer, predicted, what_if_tool
from falsifier.llm.replies import ReplyForm
from falsifier.stl import Verdict

# Maximum number of candidates predicted per call; a longer answer would cost tokens for little benefit.
MOST_CANDIDATES = 10


class Predictor(Protocol):
    """Predicts verdicts without a simulation."""

    @property
    def recent_error(self) -> float:
        """Root mean square error of recent predictions, as a share of the spread of the predicted signals."""
        ...

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        """Return the predicted verdict of each candidate; robustness is in the requirement's own unit."""
        ...


@dataclass(frozen=True, slots=True)
class WhatIf:
    """Permission to request predictions during one turn.

    Attributes:
        predictor: makes the predictions.
        calls: maximum number of calls that are answered.
    """

    predictor: Predictor
    calls: int


@dataclass
class PredictionTool:
    """Answers the calls of one turn.

    Attributes:
        what_if: the predictor and the number of calls.
        form: required form of the candidates.
        variant: prompt variant, which limits what the answers reveal.
        reveal: maps a candidate as the LLM writes it to the real one.
        hide: maps a real verdict to what the LLM may see.
        answered: number of calls answered so far.
    """

    what_if: WhatIf
    form: ReplyForm
    variant: Variant
    reveal: Callable[[Candidate], Candidate]
    hide: Callable[[Verdict], Verdict]
    answered: int = field(default=0, init=False)

    @property
    def offer(self) -> Tool:
        """The tool's description for the LLM."""
        return what_if_tool(self.form.schema(), calls=self.what_if.calls)

    def respond(self, call: ToolCall) -> str:
        """Answer one call.

        Raises:
            RejectedReplyError: stating what is wrong with it, or that the limit is reached.
        """
        if call.name != NAME:
            raise RejectedReplyError(f"there is no tool {call.name!r}, only {NAME!r}")
        if self.answered >= self.what_if.calls:
            raise RejectedReplyError(
                f"the limit of {counted(self.what_if.calls, 'call')} is reached; "
                "reply with your candidates now"
            )
        found = self.form.read_each(call.arguments)
        if all(isinstance(one, RejectedReplyError) for one in found):
            raise RejectedReplyError(f"the arguments are wrong: {found[0]}")
        self.answered += 1
        lines = self._lines(found[:MOST_CANDIDATES])
        if len(found) > MOST_CANDIDATES:
            lines.append(f"and {len(found) - MOST_CANDIDATES} more: not predicted; send fewer per call")
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
