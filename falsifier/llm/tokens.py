"""Number of tokens of a text, counted without any network; nothing is downloaded.

The vocabulary is one that litellm contains. LLMs differ mainly in how they split numbers: three digits to a
token, or each digit alone. For an unlisted LLM the larger count is used, so that limits hold.
"""

import os
import re
from functools import cache
from importlib.util import find_spec
from math import ceil
from pathlib import Path
from typing import Any

# The file of the vocabulary cl100k_base, as tiktoken names it in its cache.
_VOCABULARY = "9b5ad71b2ce5302211f9c61530b329a4922fc6a4"
# Characters per token of prompts for the bundled systems (bench/prompts.md), rounded down; used if there is
# no vocabulary. English text alone has about four.
_CHARACTERS_PER_TOKEN = 2.0
_DIGITS = re.compile(r"\d+", re.ASCII)
# Parts of the names of LLMs whose tokenizers group up to three digits.
_GROUPS_DIGITS = ("gpt-", "gpt_", "/o1", "/o3", "/o4", "llama-3", "llama3", "llama-4", "deepseek")


def count_tokens(text: str, llm: str = "") -> int:
    """Count the tokens of a text.

    Args:
        text: what is sent or received.
        llm: name of the LLM; empty: one that groups up to three digits.
    """
    encoding = _encoding()
    if encoding is None:
        return ceil(len(text) / _CHARACTERS_PER_TOKEN)
    count = len(encoding.encode_ordinary(text))
    return count if _groups_digits(llm) else count + _single_digits(text)


def _groups_digits(llm: str) -> bool:
    return not llm or any(part in llm.lower() for part in _GROUPS_DIGITS)


def _single_digits(text: str) -> int:
    """How many more tokens there are if each digit is one."""
    return sum(len(found[0]) - -(-len(found[0]) // 3) for found in _DIGITS.finditer(text))


@cache
def _encoding() -> Any:
    """The tokenizer; None if the vocabulary is not installed."""
    package = find_spec("litellm")
    for place in package.submodule_search_locations or () if package else ():
        folder = Path(place) / "litellm_core_utils" / "tokenizers"
        if (folder / _VOCABULARY).is_file() and find_spec("tiktoken"):
            os.environ.setdefault("TIKTOKEN_CACHE_DIR", str(folder))  # as litellm does itself
            if Path(os.environ["TIKTOKEN_CACHE_DIR"], _VOCABULARY).is_file():
                import tiktoken

                return tiktoken.get_encoding("cl100k_base")
    return None
