"""Options of the command line about language models: which one, how to ask it, and what they make."""

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any, get_args

import click

from falsifier.cli.options import Decorator, Function, add, repeatable
from falsifier.context.values import NOTHING
from falsifier.core.secrets import holds_credentials, is_secret_option
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.llm import CONTEXT_VARIANT, DEFAULT_VARIANT
from falsifier.llm.messages import Effort, ReplyKind

if TYPE_CHECKING:
    from falsifier.search.request import LLMSettings

# What a price is, in errors; as providers state prices.
_PRICE = "expected SENT:RECEIVED in US dollars per million tokens sent and received, for example 0.25:2"


def llm_option(*, multiple: bool = False) -> Decorator:
    text = "Language model, e.g. openai/gpt-5-mini or ollama_chat/gpt-oss:20b, or a model file (.gguf)."
    return click.option(
        "--llm",
        "llms" if multiple else "llm",
        multiple=multiple,
        metavar="NAME[@EFFORT]" if multiple else "NAME",
        help=f"{text} @EFFORT overrides --effort. Repeatable." if multiple else text,
    )


def context_option(command: Function) -> Function:
    return click.option(
        "--context",
        "context",
        multiple=True,
        metavar="FILE|fmu|none|checked:FILE",
        help="File that the language model may read: a Simulink file (.slx, .mdl), a source (.mo, .c), or a "
        "text. fmu: also documentation and sources inside the FMU; none: not the files that the spec names; "
        "checked:FILE: a line of this file looks like a key and is none. Repeatable.",
    )(command)


def effort_option(command: Function) -> Function:
    return click.option(
        "--effort", type=click.Choice(get_args(Effort)), help="Reasoning effort of the language model."
    )(command)


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


def api_base_option(command: Function) -> Function:
    return click.option("--api-base", metavar="URL", help="Address of an OpenAI-compatible server.")(command)


def anonymous_option(command: Function) -> Function:
    return click.option("--anonymous", is_flag=True, help="Use neutral names and scales in prompts.")(command)


def reply_option(command: Function) -> Function:
    return click.option(
        "--reply",
        type=click.Choice(get_args(ReplyKind)),
        help="What a reply consists of: a JSON object, or numbers between <point> and </point> as in the "
        "published prompts, which leaves control points as the spec has them; default: json.",
    )(command)


def connection_options(command: Function) -> Function:
    """Add how to reach a language model, and what it costs."""
    return add(
        command,
        api_base_option,
        click.option(
            "--llm-option",
            "llm_options",
            multiple=True,
            metavar="NAME=VALUE",
            help="Option passed to the provider unchanged, e.g. max_tokens=4000. Repeatable.",
        ),
        click.option(
            "--price",
            metavar="SENT:RECEIVED",
            help="US dollars per million tokens sent and received, if the price is not known.",
        ),
        click.option(
            "--timeout",
            type=click.FloatRange(min=0, min_open=True),
            metavar="SECONDS",
            help="Maximum time to wait for a reply of the language model; default: 600.",
        ),
        click.option("--no-cache", is_flag=True, help="Ignore cached replies."),
    )


def asking_options(command: Function) -> Function:
    """Add how to ask a language model for candidates, whichever it is."""
    return add(
        command,
        connection_options,
        anonymous_option,
        reply_option,
        click.option("--fallback", metavar="ENGINE", help="Engine to switch to if the language model fails."),
    )


def llm_options(command: Function) -> Function:
    """Add which language model to ask, and how."""
    return add(command, llm_option(), effort_option, variant_option(), asking_options)


def connection_settings(options: dict[str, Any]) -> "LLMSettings | None":
    """Take the values of llm, effort and connection_options out of a command's keyword arguments."""
    unused = {"variant": None, "fallback": None, "anonymous": False, "reply": None}
    options.update(unused)
    return llm_settings(options)


def llm_settings(options: dict[str, Any]) -> "LLMSettings | None":
    """Take the values of llm_options out of a command's keyword arguments; None if no LLM is named."""
    name = options.pop("llm")
    asked = {key: options.pop(key) for key in ("effort", "variant")}
    asked |= asking(options, named=name is not None)
    if name is None:
        _refuse_without_llm(asked)
        return None
    from falsifier.search.request import LLMSettings

    return LLMSettings(name=name, **asked)


def asking(options: dict[str, Any], *, named: bool) -> dict[str, Any]:
    """Take the values of asking_options out of a command's keyword arguments, as fields of LLMSettings.

    Raises:
        click.UsageError: if a value is invalid, or one is given although no language model is named.
    """
    given = {key: options.pop(key) for key in ("api_base", "timeout", "fallback", "anonymous", "reply")}
    if given["timeout"] is not None and not isfinite(given["timeout"]):
        raise click.UsageError(f"--timeout {given['timeout']}: expected a number of seconds")
    price, pairs = options.pop("price"), options.pop("llm_options")
    cache = not options.pop("no_cache")
    if not named:
        _refuse_without_llm(given | {"price": price, "llm_option": pairs})
    if given["reply"] is None:
        del given["reply"]
    return given | {"price": _price(price), "options": dict(map(_llm_option, pairs)), "cache": cache}


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
    stray = [f"--{key.replace('_', '-')}" for key, value in given.items() if value and key != "cache"]
    if stray:
        raise click.UsageError(
            f"{', '.join(stray)}: applies to language models only; add --llm NAME, or drop "
            f"{'it' if len(stray) == 1 else 'them'}"
        )


def _price(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        sent, received = (float(part) for part in text.split(":"))
    except ValueError:
        raise click.UsageError(f"--price {text}: {_PRICE}") from None
    if not all(isfinite(price) and price >= 0 for price in (sent, received)):
        raise click.UsageError(f"--price {text}: prices must be finite and not negative; {_PRICE}")
    return sent, received


def _llm_option(text: str) -> tuple[str, str | float]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise click.UsageError(f"--llm-option {text}: expected NAME=VALUE, for example max_tokens=4000")
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
        return name, value
    is_text = isinstance(number, float) and not isfinite(number)  # a JSON file has no such numbers
    return name, value if is_text else number
