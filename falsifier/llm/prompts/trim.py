"""Shortens a prompt to a token limit by removing history, the oldest samples first."""

from collections.abc import Callable

from falsifier.errors import ChatError
from falsifier.llm.prompts.blocks import HistoryBlock, Prompt, SampleLines
from falsifier.llm.prompts.render import render
from falsifier.llm.tokens import count_tokens

# Fits LLMs with a context of 32k tokens and leaves room for reasoning.
DEFAULT_PROMPT_TOKENS = 16_000
# What a prompt should need; the history gets at least as much as the rest, if the limit allows it.
USUAL_PROMPT_TOKENS = 6_000

_Change = Callable[[SampleLines], SampleLines | None]


def trimmed(prompt: Prompt, tokens: int = DEFAULT_PROMPT_TOKENS, llm: str = "") -> Prompt:
    """Return the prompt with as much of its history as fits.

    The details of old samples are removed first, then their facts, then the samples. The inputs and
    robustness of marked samples (the best, the most different) are removed last.

    Args:
        prompt: the full prompt.
        tokens: maximum number of tokens.
        llm: name of the LLM whose tokens are counted.

    Raises:
        ChatError: if it does not fit even without history.
    """
    bare = size(prompt.model_copy(update={"history": None}), llm)
    aim = min(tokens, max(USUAL_PROMPT_TOKENS, 2 * bare))
    for change, marked_too in _STAGES:
        position = 0
        while prompt.history is not None and position < len(prompt.history.samples):
            if size(prompt, llm) <= aim:
                return prompt
            prompt, position = _changed(prompt, prompt.history, position, change, marked_too=marked_too)
    if size(prompt, llm) > tokens:
        raise ChatError(
            f"the prompt needs {size(prompt, llm)} tokens without any history, but the limit is {tokens}: "
            "raise the limit (prompt_tokens), or choose a plainer prompt variant (--variant)"
        )
    return prompt


def size(prompt: Prompt, llm: str = "") -> int:
    """Tokens of a prompt."""
    return sum(count_tokens(m.content, llm) for m in render(prompt))


def _without_details(sample: SampleLines) -> SampleLines:
    return sample.model_copy(update={"details": ()})


def _without_facts(sample: SampleLines) -> SampleLines:
    return sample.model_copy(update={"details": (), "facts": ()})


_STAGES: tuple[tuple[_Change, bool], ...] = (
    (_without_details, False),
    (_without_details, True),
    (_without_facts, True),
    (lambda _: None, False),
    (lambda _: None, True),
)


def _changed(
    prompt: Prompt, history: HistoryBlock, position: int, change: _Change, *, marked_too: bool
) -> tuple[Prompt, int]:
    """Change the sample at this position; return the prompt and the position of the next sample."""
    sample = history.samples[position]
    if sample.mark and not marked_too:
        return prompt, position + 1
    new = change(sample)
    samples = (*history.samples[:position], *([new] if new else []), *history.samples[position + 1 :])
    smaller = history.model_copy(update={"samples": samples, "omitted": history.omitted + (0 if new else 1)})
    return prompt.model_copy(update={"history": smaller}), position + (1 if new else 0)
