"""The tool that an LLM may call before it replies: predictions for candidates, without a simulation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

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
        told, predictor = found[:MOST_CANDIDATES], self.what_if.predictor
        valid = [self.reveal(one) for one in told if isinstance(one, Candidate)]
        verdicts = iter(predictor.foresee(valid) if valid else ())
        lines = [
            predicted(self.variant, self.hide(next(verdicts)))
            if isinstance(one, Candidate)
            else f"not predicted: {one}"
            for one in told
        ]
        if len(found) > MOST_CANDIDATES:
            lines.append(f"and {len(found) - MOST_CANDIDATES} more: not predicted; send fewer per call")
        left = self.what_if.calls - self.answered
        more = f"{counted(left, 'more call')} can be answered" if left else "This was the last call"
        error = 100 * predictor.recent_error
        return "\n".join(
            (
                *(f"Candidate {i}: {line}" for i, line in enumerate(lines, start=1)),
                f"Root mean square error of recent predictions: {error:.2g} % of the signals' usual spread.",
                f"{more}; then reply with your candidates.",
            )
        )


def what_if_tool(parameters: dict[str, Any], *, calls: int) -> Tool:
    """Describe the tool to the LLM.

    Args:
        parameters: JSON Schema of the arguments: a reply's candidates, without rationale.
        calls: maximum number of calls that are answered.
    """
    return Tool(
        name=NAME,
        description=(
            "Predicts the robustness of candidates, using dynamics fitted to the samples so far. Nothing is "
            "simulated, so a prediction is free and a sample is not; but predictions can be wrong, and the "
            "answer states the size of the recent errors. Use it before you reply: compare different "
            "structures first, then refine the most promising one. Candidates have the form of the reply, "
            f"without rationale. At most {counted(calls, 'call')} per turn can be answered."
        ),
        parameters=parameters,
    )


def predicted(variant: Variant, verdict: Verdict) -> str:
    """The prediction for one candidate, limited to what the variant shows of samples."""
    parts = [f"predicted robustness {signed(verdict.robustness, 3)}"]
    if variant.has("critical"):
        by = f" by {verdict.predicate}" if variant.has("requirement") and verdict.predicate else ""
        parts.append(f"decided at about t = {number(verdict.critical_time, 4)} s{by}")
    return ", ".join(parts)
