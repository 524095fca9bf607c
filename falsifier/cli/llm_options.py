"""Options of the command line about language models: which one, how to ask it, and what they make."""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any, get_args

import click

from falsifier.cli.command import Decorator, Function, add
from falsifier.cli.options import (
    repeatable,
)
from falsifier.context.values import NOTHING
from falsifier.core.secrets import holds_credentials, is_secret_option
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.errors import did_you_mean
from falsifier.llm import CONTEXT_VARIANT, DEFAULT_VARIANT, Effort, ReplyKind

if TYPE_CHECKING:
    from falsifier.search.request import LLMSettings

# What a price is, in errors; as providers state prices.
_PRICE = "expected SENT:RECEIVED in US dollars per million tokens sent and received, for example 0.25:2"

# Words after an @ that are versions of a model, as Vertex AI has them.
_VERSIONS = ("default", "latest")


def llm_option(*, multiple: bool = False) -> Decorator:
    return click.option(
        "--llm",
        "llms" if multiple else "llm",
        multiple=multiple,
        metavar="NAME[@EFFORT]",
        help=repeatable(
            "Language model, e.g. openai/gpt-5-mini or ollama_chat/gpt-oss:20b, or a model file (.gguf); "
            f"@EFFORT is how much it reasons: {', '.join(get_args(Effort))}.",
            multiple=multiple,
        ),
    )


context_option = click.option(
    "--context",
    "context",
    multiple=True,
    metavar="FILE|fmu|none|checked:FILE",
    help="File that the language model may read: a Simulink file (.slx, .mdl), a source (.mo, .c), or a "
    "text. fmu: also documentation and sources inside the FMU; none: not the files that the spec names; "
    "checked:FILE: a line of this file looks like a key but is not. Repeatable.",
)


def variant_option(*, multiple: bool = False) -> Decorator:
    return click.option(
        "--variant",
        "variants" if multiple else "variant",
        multiple=multiple,
        metavar="MP1..MP6",
        help=repeatable(
            f"Prompt variant; default: {DEFAULT_VARIANT}, or {CONTEXT_VARIANT} with context files.",
            multiple=multiple,
        ),
    )


api_base_option = click.option("--api-base", metavar="URL", help="Address of an OpenAI-compatible server.")


anonymous_option = click.option("--anonymous", is_flag=True, help="Use neutral names and scales in prompts.")


llm_option_option = click.option(
    "--llm-option",
    "llm_options",
    multiple=True,
    metavar="NAME=VALUE",
    help="How to ask it: timeout=SECONDS (default: 600), price=SENT:RECEIVED in US dollars per million "
    "tokens, cache=no, reply=points instead of json; all other names go to the provider unchanged, e.g. "
    "max_tokens=4000. Repeatable.",
)


def connection_options(command: Function) -> Function:
    """Add how to reach a language model, and what it costs."""
    return add(command, api_base_option, llm_option_option)


def asking_options(command: Function) -> Function:
    """Add how to ask a language model for candidates, whichever it is."""
    return add(
        command,
        connection_options,
        anonymous_option,
        click.option("--fallback", metavar="ENGINE", help="Engine to switch to if the language model fails."),
    )


def llm_options(command: Function) -> Function:
    """Add which language model to ask, and how."""
    return add(command, llm_option(), variant_option(), asking_options)


def name_and_effort(text: str) -> tuple[str, str | None]:
    """Split ``NAME[@EFFORT]``; a version or a path after an @ belongs to the name.

    Raises:
        click.UsageError: if a word after an @ is neither an effort nor a version.

    >>> name_and_effort("openai/gpt-5-mini@low"), name_and_effort("vertex_ai/model@001")
    (('openai/gpt-5-mini', 'low'), ('vertex_ai/model@001', None))
    """
    name, _, level = text.rpartition("@")
    if name and level in get_args(Effort):
        return name, level
    if name and level.isalpha() and level not in _VERSIONS:
        raise click.UsageError(f"{text}: unknown effort {level!r}; {did_you_mean(level, get_args(Effort))}")
    return text, None


def connection_settings(options: dict[str, Any]) -> "LLMSettings | None":
    """Take the values of llm and connection_options out of a command's keyword arguments."""
    options.update({"variant": None, "fallback": None, "anonymous": False})
    return llm_settings(options)


def llm_settings(options: dict[str, Any]) -> "LLMSettings | None":
    """Take the values of llm_options out of a command's keyword arguments; None if no model is named.

    Raises:
        click.UsageError: if a value is invalid, or one is given although no language model is named.
    """
    given, variant = options.pop("llm"), options.pop("variant")
    asked = asking(options, named=given is not None)
    if given is None:
        _refuse_without_llm({"variant": variant})
        return None
    from falsifier.search.request import LLMSettings

    name, effort = name_and_effort(given)
    return LLMSettings(name=name, effort=effort, variant=variant, **asked)


def asking(options: dict[str, Any], *, named: bool) -> dict[str, Any]:
    """Take the values of asking_options out of a command's keyword arguments, as fields of LLMSettings.

    Raises:
        click.UsageError: if a value is invalid, or one is given although no language model is named.
    """
    given = {key: options.pop(key) for key in ("api_base", "fallback", "anonymous")}
    pairs = options.pop("llm_options")
    if not named:
        _refuse_without_llm(given | {"llm_option": pairs})
    return given | read_llm_options(pairs)


def read_llm_options(pairs: Sequence[str]) -> dict[str, Any]:
    """Return the values of ``--llm-option`` as fields of LLMSettings.

    Raises:
        click.UsageError: if one is invalid.
    """
    fields: dict[str, Any] = {}
    passed: dict[str, str | float] = {}
    for text in pairs:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise click.UsageError(f"--llm-option {text}: expected NAME=VALUE, for example max_tokens=4000")
        if name in _FIELDS:
            fields[name] = _FIELDS[name](text, value)
        else:
            passed[name] = _passed(name, value)
    return fields | {"options": passed}


def refuse_limits_without_llm(*, max_tokens: int | None, max_cost: float | None) -> None:
    """Refuse limits of a language model although none is named.

    Raises:
        click.UsageError: naming the options.
    """
    _refuse_without_llm({"max_tokens": max_tokens, "max_cost": max_cost})


def check_context(named: Sequence[str], engines: Sequence[str | None]) -> None:
    """Refuse context that nothing reads.

    Args:
        named: values of ``--context``.
        engines: engines without a language model, None for the default one; empty if one is asked.

    Raises:
        click.UsageError: naming the option.
    """
    found = (ENGINES.get(engine or DEFAULT_ENGINE) for engine in engines)
    used = [engine is None or engine.uses_context for engine in found]  # unknown names are refused later
    if set(named) - {NOTHING} and used and not any(used):
        raise click.UsageError(
            "--context: applies to language models and to the engine surrogate; add --llm NAME, or drop it"
        )


def _refuse_without_llm(given: dict[str, Any]) -> None:
    stray = [f"--{key.replace('_', '-')}" for key, value in given.items() if value]
    if stray:
        raise click.UsageError(
            f"{', '.join(stray)}: applies to language models only; add --llm NAME, or drop "
            f"{'it' if len(stray) == 1 else 'them'}"
        )


def _price(text: str, value: str) -> tuple[float, float]:
    try:
        sent, received = (float(part) for part in value.split(":"))
    except ValueError:
        raise click.UsageError(f"--llm-option {text}: {_PRICE}") from None
    if not all(isfinite(price) and price >= 0 for price in (sent, received)):
        raise click.UsageError(f"--llm-option {text}: prices must be finite and not negative; {_PRICE}")
    return sent, received


def _timeout(text: str, value: str) -> float:
    try:
        seconds = float(value)
    except ValueError:
        seconds = 0.0
    if not isfinite(seconds) or seconds <= 0:
        raise click.UsageError(f"--llm-option {text}: expected a number of seconds above 0")
    return seconds


def _cache(text: str, value: str) -> bool:
    if value not in ("yes", "no"):
        raise click.UsageError(f"--llm-option {text}: expected yes, or no to ignore stored replies")
    return value == "yes"


def _reply(text: str, value: str) -> str:
    if value not in get_args(ReplyKind):
        kinds = did_you_mean(value, get_args(ReplyKind))
        raise click.UsageError(f"--llm-option {text}: unknown kind of reply; {kinds}")
    return value


# Names of --llm-option that the provider does not see: fields of LLMSettings.
_FIELDS: dict[str, Callable[[str, str], Any]] = {
    "price": _price,
    "timeout": _timeout,
    "cache": _cache,
    "reply": _reply,
}


def _passed(name: str, value: str) -> str | float:
    """Return the value of an option for the provider, as a number if it is one."""
    if is_secret_option(name):  # options are written to the run's manifest
        raise click.UsageError(
            f"--llm-option {name}: keys are read from the environment only; set the provider's variable"
        )
    if holds_credentials(value):
        raise click.UsageError(
            f"--llm-option {name}: contains a user name or a password, and options are recorded; state them "
            "in the environment"
        )
    try:
        number = int(value) if value.isdigit() else float(value)
    except ValueError:
        return value
    is_text = isinstance(number, float) and not isfinite(number)  # a JSON file has no such numbers
    return value if is_text else number
