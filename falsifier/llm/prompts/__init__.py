"""Prompts: what an LLM is sent; a constant part, the samples so far, and what is new."""

from falsifier.llm.prompts.question import MOST_PROMPT_TOKENS, Questions
from falsifier.llm.prompts.view import VARIANTS, Variant, View, variant_named

__all__ = ["MOST_PROMPT_TOKENS", "VARIANTS", "Questions", "Variant", "View", "variant_named"]
