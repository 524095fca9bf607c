"""The tool by which an LLM asks what a candidate would give: what it is told of it, and the answers."""

from collections.abc import Sequence
from typing import Any

from falsifier.llm.messages import Tool
from falsifier.llm.prompts.numbers import number, signed
from falsifier.llm.prompts.variants import Variant
from falsifier.stl import Verdict

NAME = "predict"


def what_if_tool(parameters: dict[str, Any], *, calls: int) -> Tool:
    """Tool as it is offered.

    Args:
        parameters: JSON Schema of the arguments: a reply's candidates, without rationale.
        calls: how many calls are answered.
    """
    return Tool(
        name=NAME,
        description=(
            "Predicts what candidates would give, by a numerical model of the dynamics that was fitted to "
            "the samples so far. Nothing is simulated, so asking is free where a sample is not; but "
            "predictions err, and the answer says by how much they did of late. Ask before you reply: "
            "compare different structures first, then change the most promising one. Candidates have the "
            f"form of the reply, without rationale. At most {calls} calls are answered in a turn."
        ),
        parameters=parameters,
    )


def predicted(variant: Variant, verdict: Verdict) -> str:
    """What is predicted of one candidate, as far as the variant tells such things of samples."""
    parts = [f"predicted robustness {signed(verdict.robustness)}"]
    if variant.has("critical"):
        by = f" by {verdict.predicate}" if variant.has("requirement") and verdict.predicate else ""
        parts.append(f"decided at about t = {number(verdict.critical_time, 4)} s{by}")
    return ", ".join(parts)


def answer(lines: Sequence[str], *, error: float, left: int) -> str:
    """Answer to one call.

    Args:
        lines: what is said of each candidate.
        error: of recent predictions, as a share of the spread of what was predicted.
        left: how many more calls are answered.
    """
    more = f"{left} more call{'s are' if left != 1 else ' is'} answered" if left else "This was the last call"
    return "\n".join(
        (
            *(f"Candidate {i}: {line}" for i, line in enumerate(lines, start=1)),
            f"Recent predictions of the signals were off by {100 * error:.2g} % of their usual "
            "spread (root mean square).",
            f"{more}; then reply with your candidates.",
        )
    )
