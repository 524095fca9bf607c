"""The tool that an LLM may call before it replies: predictions for candidates, without a simulation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.llm.conversation import RejectedReplyError
from falsifier.llm.messages import Tool, ToolCall
from falsifier.llm.prompts.numbers import number
from falsifier.llm.prompts.view import Variant
from falsifier.llm.replies import ReplyForm
from falsifier.stl import Verdict
from falsifier.stl.margins import signed

NAME = "predict"
# Maximum number of candidates predicted per call; a longer answer would cost tokens for little benefit.
MOST_CANDIDATES = 10
# Maximum number of calls per turn that are answered. Each sends the whole conversation again, so three cost
# up to four requests plus rejected replies: enough to compare, correct and check.
MOST_CALLS = 3


class Predictor(Protocol):
    """Predicts verdicts without a simulation."""

    @property
    def recent_error(self) -> float:
        """Root mean square error of recent predictions, as a share of the spread of the predicted signals."""
        ...

    def foresee(self, candidates: Sequence[Candidate]) -> list[Verdict]:
        """Return the predicted verdict of each candidate; robustness is in the requirement's own unit."""
        ...


@dataclass
class PredictionTool:
    """Answers the calls of one turn.

    Attributes:
        predictor: makes the predictions.
        form: required form of the candidates.
        variant: prompt variant, which limits what the answers reveal.
        reveal: maps a candidate as the LLM writes it to the real one.
        hide: maps a real verdict to what the LLM may see.
        answered: number of calls answered so far.
    """

    predictor: Predictor
    form: ReplyForm
    variant: Variant
    reveal: Callable[[Candidate], Candidate]
    hide: Callable[[Verdict], Verdict]
    answered: int = field(default=0, init=False)

    @property
    def offer(self) -> Tool:
        """The tool's description for the LLM."""
        return Tool(
            name=NAME,
            description=(
                "Predicts the robustness of candidates, using dynamics fitted to the samples so far. Nothing "
                "is simulated, so a prediction is free and a sample is not; but predictions can be wrong, "
                "and the answer states the size of the recent errors. Use it before you reply: compare "
                "different structures first, then refine the most promising one. Candidates have the form of "
                f"the reply, without rationale. At most {counted(MOST_CALLS, 'call')} per turn can be "
                "answered."
            ),
            parameters=self.form.schema(),
        )

    def respond(self, call: ToolCall) -> str:
        """Answer one call.

        Raises:
            RejectedReplyError: stating what is wrong with it, or that the limit is reached.
        """
        if call.name != NAME:
            raise RejectedReplyError(f"there is no tool {call.name!r}, only {NAME!r}")
        if self.answered >= MOST_CALLS:
            raise RejectedReplyError(
                f"the limit of {counted(MOST_CALLS, 'call')} is reached; reply with your candidates now"
            )
        found = self.form.read_each(call.arguments)
        if all(isinstance(one, RejectedReplyError) for one in found):
            raise RejectedReplyError(f"the arguments are wrong: {found[0]}")
        self.answered += 1
        told = found[:MOST_CANDIDATES]
        valid = [self.reveal(one) for one in told if isinstance(one, Candidate)]
        verdicts = iter(self.predictor.foresee(valid) if valid else ())
        lines = [
            predicted(self.variant, self.hide(next(verdicts)))
            if isinstance(one, Candidate)
            else f"not predicted: {one}"
            for one in told
        ]
        if len(found) > MOST_CANDIDATES:
            lines.append(f"and {len(found) - MOST_CANDIDATES} more: not predicted; send fewer per call")
        left = MOST_CALLS - self.answered
        more = f"{counted(left, 'more call')} can be answered" if left else "This was the last call"
        error = 100 * self.predictor.recent_error
        return "\n".join(
            (
                *(f"Candidate {i}: {line}" for i, line in enumerate(lines, start=1)),
                f"Root mean square error of recent predictions: {error:.2g} % of the signals' usual spread.",
                f"{more}; then reply with your candidates.",
            )
        )


def predicted(variant: Variant, verdict: Verdict) -> str:
    """The prediction for one candidate, limited to what the variant shows of samples."""
    parts = [f"predicted robustness {signed(verdict.robustness, 3)}"]
    if variant.has("critical"):
        by = f" by {verdict.predicate}" if variant.has("requirement") and verdict.predicate else ""
        parts.append(f"decided at about t = {number(verdict.critical_time, 4)} s{by}")
    return ", ".join(parts)
