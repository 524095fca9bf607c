"""The tool with which an LLM requests predictions for candidates: its description and its answers."""

from collections.abc import Sequence
from typing import Any

from falsifier.core.words import counted
from falsifier.llm.messages import Tool
from falsifier.llm.prompts.numbers import number
from falsifier.llm.prompts.variants import Variant
from falsifier.stl import Verdict
from falsifier.stl.margins import signed

NAME = "predict"


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


def answer(lines: Sequence[str], *, error: float, left: int) -> str:
    """Answer one call.

    Args:
        lines: one line per candidate.
        error: error of recent predictions as a share of the spread of the predicted signals.
        left: number of calls that remain.
    """
    more = f"{counted(left, 'more call')} can be answered" if left else "This was the last call"
    return "\n".join(
        (
            *(f"Candidate {i}: {line}" for i, line in enumerate(lines, start=1)),
            f"Root mean square error of recent predictions: {100 * error:.2g} % of the signals' usual "
            "spread.",
            f"{more}; then reply with your candidates.",
        )
    )
