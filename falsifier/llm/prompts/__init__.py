"""Prompts: what an LLM is sent; a constant part, the samples so far, and what is new."""

from falsifier.llm.prompts.question import DEFAULT_PROMPT_TOKENS, Questions
from falsifier.llm.prompts.variants import VARIANTS, Variant, variant_named
from falsifier.llm.prompts.view import View

__all__ = ["DEFAULT_PROMPT_TOKENS", "VARIANTS", "Questions", "Variant", "View", "variant_named"]
