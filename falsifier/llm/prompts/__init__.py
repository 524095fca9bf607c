"""Prompts: what an LLM is sent; a constant part, the samples so far, and what is new."""

from falsifier.llm.prompts.question import MOST_PROMPT_TOKENS as MOST_PROMPT_TOKENS, Questions as Questions
from falsifier.llm.prompts.view import (
    VARIANTS as VARIANTS,
    Variant as Variant,
    View as View,
    variant_named as variant_named,
)
