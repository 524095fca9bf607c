"""litellm, imported here and nowhere else, and only when an LLM is used."""

import os
import warnings
from collections.abc import Mapping
from functools import cache
from typing import Any

from falsifier.errors import ChatError, ChatSetupError, did_you_mean
from falsifier.llm.providers import PROVIDERS, known
from falsifier.llm.usage import Price

# What litellm would do unasked when it is imported or first used, and how it is told not to.
_ENVIRONMENT = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",  # fetch a price list
    "LITELLM_LOCAL_ANTHROPIC_BETA_HEADERS": "True",  # fetch a list of headers
    "LITELLM_MODE": "PRODUCTION",  # read a .env file
}
# Parameters that litellm drops for models which do not take them.
_DROPPABLE = frozenset(
    {"temperature", "top_p", "seed", "max_tokens", "reasoning_effort", "stop", "presence_penalty",
     "frequency_penalty"}
)  # fmt: skip


@cache
def load_litellm() -> Any:
    """Import litellm, which takes seconds, without its network access, its .env file and its prints.

    Raises:
        ChatError: when it is not installed.
    """
    os.environ.update(_ENVIRONMENT)
    try:
        import litellm
    except ImportError as error:
        raise ChatError(f"litellm cannot be imported ({error}): pip install litellm") from None
    litellm.suppress_debug_info = True
    # Its types make pydantic warn of something that is none of the user's business.
    warnings.filterwarnings("ignore", message=".*`ReadOnly` qualifier", category=UserWarning)
    return litellm


def check_name(llm: str) -> None:
    """Refuse a name whose provider nobody knows; listed providers need no import for that.

    Raises:
        ChatSetupError: with the form that is expected.
    """
    provider, _, name = llm.partition("/")
    if name and (provider in PROVIDERS or _knows(llm)):
        return
    raise ChatSetupError(
        f"{llm!r} names no known provider and model: expected PROVIDER/MODEL such as openai/gpt-5-mini; "
        f"{did_you_mean(provider, PROVIDERS)}"
    )


def listed_price(llm: str) -> Price | None:
    """Price of an LLM in litellm's table; None where it is not listed, or falsely listed as free."""
    try:
        info = load_litellm().get_model_info(llm)
    except ChatError:
        raise
    except Exception:  # not in the table
        return None
    prompt, completion = info.get("input_cost_per_token"), info.get("output_cost_per_token")
    if prompt is None or completion is None or (not prompt and not completion and not known(llm).local):
        return None
    return Price(1000 * prompt, 1000 * completion)


def may_take_tools(llm: str, *, api_base: str | None = None) -> bool:
    """Whether tools are worth offering: False only where litellm lists the LLM as one that takes none.

    What a server of one's own takes, only the server can say.
    """
    if api_base is not None or known(llm).local:
        return True
    litellm = load_litellm()
    try:
        litellm.get_model_info(llm)
    except Exception:  # not in the table
        return True
    return bool(litellm.supports_function_calling(llm))


def dropped_parameters(llm: str, arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of those arguments that litellm leaves out because the LLM does not take them."""
    allowed = set(arguments.get("allowed_openai_params", ()))
    stated = {k: v for k, v in arguments.items() if k in _DROPPABLE and k not in allowed}
    effort = {k: v for k, v in stated.items() if k == "reasoning_effort"}
    return tuple(name for name in stated if not _takes(llm, {**effort, name: stated[name]}))


def _knows(llm: str) -> bool:
    litellm = load_litellm()
    try:
        litellm.get_llm_provider(llm)
    except Exception:  # litellm raises several kinds for names that it does not know
        return False
    return True


def _takes(llm: str, arguments: Mapping[str, Any]) -> bool:
    litellm = load_litellm()
    try:
        name, provider, *_ = litellm.get_llm_provider(llm)
        litellm.utils.get_optional_params(
            model=name, custom_llm_provider=provider, drop_params=False, **arguments
        )
    except litellm.UnsupportedParamsError:
        return False
    except Exception:  # nothing can be said, and the request itself will tell
        return True
    return True
