"""Prompts: what an LLM is sent, first as typed blocks, then as text."""

from falsifier.llm.prompts.blocks import Prompt
from falsifier.llm.prompts.build import build_prompt
from falsifier.llm.prompts.render import render
from falsifier.llm.prompts.trim import DEFAULT_PROMPT_TOKENS, trimmed
from falsifier.llm.prompts.variants import VARIANTS, Variant, variant_named
from falsifier.llm.prompts.view import View

__all__ = [
    "DEFAULT_PROMPT_TOKENS",
    "VARIANTS",
    "Prompt",
    "Variant",
    "View",
    "build_prompt",
    "render",
    "trimmed",
    "variant_named",
]
