"""litellm: imported here and nowhere else, only when an LLM is used, because the import takes seconds.

What works around it stands here, each with the version in which it was seen and the issue of
github.com/BerriAI/litellm that tells of it:

- On import it reads a .env file (1.106.2, #12576) and fetches lists from the network (1.106.2, #2677):
  ``_ENVIRONMENT`` prevents both, and warnings of finish reasons that it does not know (1.106.2, no issue).
- It makes pydantic warn of its own types (1.83, #37949) and of replies in another form than its own
  (1.106.2, #11759): ``_WARNINGS`` are not shown.
- It takes an HTTP client for OpenAI's library only (1.106.2, #13049): ``_guard`` lets its handler make one.
- Without ``max_retries`` OpenAI's library sends a failed request again (1.106.2, #5124): ``completed``.
- Without an address it asks OpenAI, whoever the provider is (1.106.2, no issue): ``HOST_OF_OPENAI``. That
  library takes headers from the environment, whatever server it asks: ``headers_of_openai``.
- Of some providers it drops an effort that they take, unless the parameter is named (1.106.2, #14039):
  ``Provider.names_effort``.
- It lists prices that nobody knows as zero (huggingface, 1.106.2, no issue): ``listed_price``.
- It puts the classes of its errors before a server's words, several times over, and a stack trace after them
  (1.106.2, #9682): ``own_words``, ``without_trace``.
- It replaces every error if tenacity is missing (#19462): that is among our requirements.
"""

import os
import re
import warnings
from collections.abc import Mapping
from functools import cache
from inspect import signature
from typing import Any

from falsifier.errors import ChatError, ChatSetupError, did_you_mean, written
from falsifier.llm.providers import PROVIDERS, known, provider_of, stated_address
from falsifier.llm.transport import guarded_client
from falsifier.llm.usage import Price

HOST_OF_OPENAI = "api.openai.com"
_OF_ACCOUNT = {
    "OPENAI_ORGANIZATION": "OpenAI-Organization",
    "OPENAI_ORG_ID": "OpenAI-Organization",
    "OPENAI_PROJECT_ID": "OpenAI-Project",
}
_OF_ANY_REQUEST = {"accept", "content-type"}
_ENVIRONMENT = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",
    "LITELLM_LOCAL_ANTHROPIC_BETA_HEADERS": "True",
    "LITELLM_MODE": "PRODUCTION",
    "LITELLM_LOG": "CRITICAL",
}
_WARNINGS = (".*`?ReadOnly`? qualifier", "Pydantic serializer warnings")
_CLASSES = re.compile(r"(?:(?:litellm\.)?\w+(?:Error|Exception|Timeout)(?:: ?| - |$))+")
_TRACE = "Traceback (most recent call last)"
# Parameters that litellm drops for LLMs that do not accept them.
_DROPPABLE = frozenset(
    {"temperature", "top_p", "seed", "max_tokens", "reasoning_effort", "stop", "presence_penalty",
     "frequency_penalty"}
)  # fmt: skip


@cache
def load_litellm() -> Any:
    """Import litellm without network, .env file and messages; ChatError if it cannot be imported."""
    os.environ.update(_ENVIRONMENT)
    try:
        import litellm
    except ImportError as error:
        raise ChatError(f"litellm cannot be imported ({error}): pip install litellm") from None
    litellm.suppress_debug_info = True
    for text in _WARNINGS:
        warnings.filterwarnings("ignore", message=text, category=UserWarning)
    _guard(litellm)
    return litellm


def _guard(litellm: Any) -> None:
    """Let litellm make its HTTP clients so that requests can be limited and cut."""
    from litellm.llms.custom_httpx.http_handler import HTTPHandler, get_ssl_configuration

    litellm.client_session = guarded_client(verify=get_ssl_configuration())
    HTTPHandler.create_client = lambda self: guarded_client(verify=get_ssl_configuration(self.ssl_verify))


def completed(llm: str, **arguments: Any) -> Any:
    """Send one request, and only one, and return litellm's response; arguments as of its ``completion``."""
    if known(llm).openai_client:
        arguments["max_retries"] = 0
    # What the LLM does not accept is omitted; dropped_parameters() tells it.
    return load_litellm().completion(model=llm, drop_params=True, **arguments)


def headers_of_openai() -> list[tuple[str, str]]:
    """Headers of the environment that are for OpenAI's server: who pays, and what else the user states."""
    lines = [f"{name}: {os.environ.get(variable, '')}" for variable, name in _OF_ACCOUNT.items()]
    lines += os.environ.get("OPENAI_CUSTOM_HEADERS", "").split("\n")
    found = [(name.strip(), value.strip()) for name, _, value in (line.partition(":") for line in lines)]
    return [(name, value) for name, value in found if value and name.lower() not in _OF_ANY_REQUEST]


def without_trace(text: str) -> str:
    """The text of an error in one line, without the stack trace that litellm may append."""
    return " ".join(text.split(_TRACE)[0].split())


def own_words(text: str) -> str:
    """What a server said in an error, without the classes of litellm's errors."""
    return _CLASSES.sub("", text, count=1).strip() if _CLASSES.match(text) else text


def check_name(llm: str) -> None:
    """Reject a name with an unknown provider, without importing litellm for listed ones; ChatSetupError."""
    provider, _, name = llm.partition("/")
    if name.strip("/ ") and (provider in PROVIDERS or _knows(llm)):
        return
    if provider in PROVIDERS:
        raise ChatSetupError(
            f"{llm!r} names a provider, but no model: expected PROVIDER/MODEL such as openai/gpt-5-mini"
        )
    raise ChatSetupError(
        f"{llm!r} does not name a known provider: expected PROVIDER/MODEL such as openai/gpt-5-mini; "
        f"{did_you_mean(provider, PROVIDERS)}"
    )


def listed_price(llm: str, *, api_base: str | None = None) -> Price | None:
    """Price of an LLM in litellm's table; None if it is not listed, or wrongly listed as free.

    Another server under a listed name has its own prices, unless it is the user's own machine.
    """
    if stated_address(llm, api_base) is not None and not known(llm).local:
        return None
    litellm = load_litellm()
    try:
        info = litellm.get_model_info(llm)
    except Exception:  # not in the table
        return None
    prompt, completion = info.get("input_cost_per_token"), info.get("output_cost_per_token")
    if prompt is None or completion is None or (not prompt and not completion and not known(llm).local):
        return None
    return Price(1e6 * prompt, 1e6 * completion)


def check_options(llm: str, options: Mapping[str, Any], *, api_base: str | None = None) -> None:
    """Reject options that the provider does not have.

    What a user's own server, a router or an unlisted one takes is not known: options are sent as they are.

    Raises:
        ChatSetupError: naming the option.
    """
    if "timeout" in options:
        raise ChatSetupError("timeout: pass it as an argument; in options it would not limit slow replies")
    provider = known(llm)
    is_own = stated_address(llm, api_base) is not None or provider.local or not provider.keys
    if not options or is_own or provider.routes:
        return
    listed, taken = _options_of(llm)
    for name in options:
        if name not in taken:
            given = written(f"--llm-option {name}", name)
            raise ChatSetupError(
                f"{given}: {provider_of(llm)} has no such option; {did_you_mean(name, listed)}. What litellm "
                "does not know can be sent in Python: connect(NAME, options={'extra_body': {...}})"
            )


def _options_of(llm: str) -> tuple[list[str], set[str]]:
    """Names of an LLM's and its provider's options, and of all that litellm takes, its internal ones too."""
    litellm = load_litellm()
    from litellm.types.utils import all_litellm_params
    from litellm.utils import ProviderConfigManager

    name, provider, *_ = litellm.get_llm_provider(llm)
    own = [*(litellm.get_supported_openai_params(model=name, custom_llm_provider=provider) or ()), "timeout"]
    config = ProviderConfigManager.get_provider_chat_config(name, litellm.LlmProviders(provider))
    for kind in type(config).__mro__:
        stated = getattr(kind, "__annotations__", {})
        own += [key for key in stated if key.islower() and key[0] != "_" and key not in own]
    others = {*signature(litellm.completion).parameters, *all_litellm_params, "extra_body", "max_retries"}
    return own, {name for name in (*own, *others) if name[0] != "_"} - {"kwargs", "self"}


def dropped_parameters(llm: str, arguments: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the arguments that litellm omits because the LLM does not accept them."""
    allowed = set(arguments.get("allowed_openai_params", ()))
    stated = {k: v for k, v in arguments.items() if k in _DROPPABLE and k not in allowed}
    effort = {k: v for k, v in stated.items() if k == "reasoning_effort"}
    return tuple(name for name in stated if not _takes(llm, {**effort, name: stated[name]}))


def _knows(llm: str) -> bool:
    litellm = load_litellm()
    try:
        litellm.get_llm_provider(llm)
    except Exception:  # litellm raises various exceptions for unknown names
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
    except Exception:  # unknown here; the request itself will show it
        return True
    return True
