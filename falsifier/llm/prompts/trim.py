"""Shortens a prompt to a token limit by removing history, what matters least first."""

from collections.abc import Callable

from falsifier.errors import ChatError
from falsifier.llm.prompts.blocks import Prompt, SampleLines
from falsifier.llm.prompts.render import render
from falsifier.llm.usage import count_tokens

# Fits LLMs with a context of 32k tokens and leaves room for reasoning.
DEFAULT_PROMPT_TOKENS = 16_000
# What a prompt should need; the history gets at least as much as the rest, if the limit allows it.
USUAL_PROMPT_TOKENS = 6_000

_Change = Callable[[SampleLines], SampleLines | None]


def trimmed(prompt: Prompt, tokens: int = DEFAULT_PROMPT_TOKENS, llm: str = "") -> Prompt:
    """Return the prompt with as much of its history as fits.

    The details of samples are removed first, then their facts, then the samples; of each, those with the
    smallest weight and the oldest first, so that the best and the latest sample stay longest.

    Args:
        prompt: the full prompt.
        tokens: maximum number of tokens.
        llm: name of the LLM whose tokens are counted.

    Raises:
        ChatError: if it does not fit even without history.
    """
    bare = size(prompt.model_copy(update={"history": None}), llm)
    aim = min(tokens, max(USUAL_PROMPT_TOKENS, 2 * bare))
    for change in (_without_details, _without_facts, _dropped):
        for number in _lightest_first(prompt):
            if size(prompt, llm) <= aim:
                return prompt
            prompt = _changed(prompt, number, change)
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


def _dropped(sample: SampleLines) -> None:
    return None


def _lightest_first(prompt: Prompt) -> list[int]:
    """Numbers of the samples; of those with the same weight, the oldest first."""
    samples = prompt.history.samples if prompt.history is not None else ()
    return [s.number for s in sorted(samples, key=lambda s: (s.weight, s.number))]


def _changed(prompt: Prompt, number: int, change: _Change) -> Prompt:
    """Change the sample with this number."""
    assert prompt.history is not None
    changed = (change(s) if s.number == number else s for s in prompt.history.samples)
    samples = tuple(s for s in changed if s is not None)
    lost = len(prompt.history.samples) - len(samples)
    smaller = prompt.history.model_copy(update={"samples": samples, "omitted": prompt.history.omitted + lost})
    return prompt.model_copy(update={"history": smaller})
