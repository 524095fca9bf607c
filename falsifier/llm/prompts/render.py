"""From a prompt to messages: pure text, block by block."""

from collections.abc import Iterable

from falsifier.llm.messages import Message
from falsifier.llm.prompts.blocks import (
    AdviceBlock,
    HistoryBlock,
    InputsBlock,
    OutputsBlock,
    Prompt,
    ReplyBlock,
    RequirementBlock,
    SampleLines,
    TaskBlock,
)


def render(prompt: Prompt) -> tuple[Message, ...]:
    """Messages of a prompt: the task and what stays the same first, what changes last."""
    standing: list[str] = [_task(prompt.task)]
    if prompt.requirement is not None:
        standing.append(_requirement(prompt.requirement))
    if prompt.outputs is not None:
        standing.append(_outputs(prompt.outputs))
    standing.append(_inputs(prompt.inputs))
    if prompt.advice is not None:
        standing.append(_advice(prompt.advice))
    standing.append(_reply(prompt.reply, prompt.task.count))
    return (
        Message(role="system", content="\n\n".join(standing)),
        Message(role="user", content=_history(prompt.history, prompt.task.count)),
    )


def _task(task: TaskBlock) -> str:
    aim = (
        "Find inputs for which the requirement below is violated, in as few simulations as possible."
        if task.knows_requirement
        else "Find a point at which its value is negative, in as few simulations as possible."
    )
    what = (
        "You search for a counterexample: a system is simulated with inputs that you choose, and a monitor "
        "returns the robustness, which says by how much its requirement holds."
        if task.knows_requirement
        else "You minimise an unknown function, the robustness of a simulated system."
    )
    sign = "Robustness below 0 is a violation; exactly 0 is not. Smaller is closer to a violation."
    return f"{what} {aim} {sign}"


def _requirement(block: RequirementBlock) -> str:
    return f"Requirement, in Signal Temporal Logic with times in seconds:\n{block.formula}"


def _outputs(block: OutputsBlock) -> str:
    names = ", ".join(s.name for s in block.signals)
    return f"Output signals: {names or 'none; the requirement speaks of inputs only'}"


def _inputs(block: InputsBlock) -> str:
    lines = [
        f"You choose {len(block.dimensions)} numbers. The simulation runs from 0 to {block.stop_time} s."
    ]
    for d in block.dimensions:
        meaning = f": {d.meaning}" if d.meaning else ""
        lines.append(f"{d.number}{meaning}, from {d.low} to {d.high}")
    return "\n".join(lines)


def _advice(block: AdviceBlock) -> str:
    return "\n".join(block.lines)


def _reply(block: ReplyBlock, count: int) -> str:
    many = f" with {count} different candidates" if count > 1 else ""
    return "\n".join(
        (
            f"Reply with one JSON object{many} in this form, with values of your own and one or two "
            "sentences of rationale:",
            block.example,
            *block.notes,
        )
    )


def _history(block: HistoryBlock | None, count: int) -> str:
    wanted = "the first sample" if block is None else "the next sample"
    if count > 1:
        wanted = f"{wanted}s ({count} different ones)"
    request = f"Propose {wanted}."
    if block is None:
        return request
    parts: list[str] = []
    if block.samples:
        shown = f" (the {len(block.samples)} most recent)" if block.omitted else ""
        parts.append(f"Samples so far{shown}, in the order in which they were simulated:")
        parts.extend(_sample(s) for s in block.samples)
    if block.pending:
        parts.append("Already proposed, results not known yet: " + " | ".join(block.pending))
    return "\n\n".join((*parts, f"{request} Do not repeat an earlier one."))


def _sample(sample: SampleLines) -> str:
    return "\n".join(_sample_lines(sample))


def _sample_lines(sample: SampleLines) -> Iterable[str]:
    yield f"Sample {sample.number}: {'; '.join(sample.inputs)}"
    yield f"  robustness {sample.robustness}"
    for fact in sample.facts:
        yield f"  {fact}"
