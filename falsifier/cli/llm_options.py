"""Options of the command line about language models: which one, how to ask it, and what they make."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, get_args

import click

from falsifier.cli.command import Decorator, Function, add, refuse
from falsifier.cli.options import option
from falsifier.context.values import NOTHING
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.errors import did_you_mean
from falsifier.llm import CONTEXT_VARIANT, DEFAULT_VARIANT, Effort
from falsifier.search import DEFAULT_SIMULATIONS

if TYPE_CHECKING:
    from falsifier.search.budget import Budget
    from falsifier.search.request import LLMSettings

# Options that a command may have about a language model, and limits of a run, as it receives them.
_ASKED = ("variant", "api_base", "anonymous")
_LIMITS = ("budget", "seconds", "max_tokens", "max_cost")
# Names of --llm-option that the provider does not see, fields of LLMSettings, and what they expect.
_EXPECTED = {
    "price": "expected SENT:RECEIVED, finite numbers from 0 on, US dollars per million tokens, as 0.25:2",
    "timeout": "expected a number of seconds above 0",
    "cache": "expected yes, or no to ignore stored replies",
}
_WITHOUT_LLM = "applies to language models only; add --llm NAME, or leave it out"
# Words after an @ that are versions of a model, as Vertex AI has them.
_VERSIONS = ("default", "latest")


def llm_option(*, multiple: bool = False) -> Decorator:
    return option(
        "--llm",
        "llm",
        "Language model, e.g. openai/gpt-5-mini or ollama_chat/gpt-oss:20b, or a model file (.gguf); @EFFORT "
        f"is how much it reasons: {', '.join(get_args(Effort))}.",
        multiple=multiple,
        metavar="NAME[@EFFORT]",
    )


context_option = click.option(
    "--context",
    "context",
    multiple=True,
    metavar="FILE|fmu|none|checked:FILE",
    help="File that the language model, or the engine surrogate, may read: a Simulink file (.slx, .mdl), a "
    "source (.mo, .c), or a text. fmu: also documentation and sources inside the FMU; none: not the files "
    "that the spec names; checked:FILE: a line of this file looks like a key but is not. Repeatable.",
)


def variant_option(*, multiple: bool = False) -> Decorator:
    return option(
        "--variant",
        "variant",
        f"Prompt variant; default: {DEFAULT_VARIANT}, or {CONTEXT_VARIANT} with context files.",
        multiple=multiple,
        metavar="MP1..MP6",
    )


anonymous_option = click.option("--anonymous", is_flag=True, help="Use neutral names in prompts.")


def connection_options(command: Function) -> Function:
    """Add how to reach a language model, and what it costs."""
    return add(
        command,
        click.option("--api-base", metavar="URL", help="Address of an OpenAI-compatible server."),
        click.option(
            "--llm-option",
            "llm_options",
            multiple=True,
            metavar="NAME=VALUE",
            help="Option of requests to the language model: timeout=SECONDS (default: 600, of a check 60), "
            "price=SENT:RECEIVED in US dollars per million tokens, cache=no; any other NAME goes to the "
            "provider unchanged, e.g. max_tokens=4000. Repeatable.",
        ),
    )


def llm_options(command: Function, *, multiple: bool = False) -> Function:
    """Add which language model to ask, or which several, and how."""
    chosen = llm_option(multiple=multiple), variant_option(multiple=multiple)
    return add(command, *chosen, connection_options, anonymous_option)


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


def llm_settings(options: dict[str, Any]) -> "LLMSettings | None":
    """Take the values of llm_options, as far as a command has them, out of its keyword arguments.

    Returns:
        Which language model to ask, and how; None if none is named.

    Raises:
        click.UsageError: if a value is invalid, or one is given although no language model is named.
    """
    llm = options.pop("llm")
    pairs = options.pop("llm_options")
    asked = {name: options.pop(name) for name in _ASKED if name in options}
    if llm is None:
        refuse(_WITHOUT_LLM, **asked, llm_option=pairs)
        return None
    from pydantic import ValidationError

    from falsifier.search.request import LLMSettings

    name, effort = name_and_effort(llm)
    given = dict(map(_name_and_value, pairs))
    if len(given) < len(pairs):
        raise click.UsageError("--llm-option: a NAME is given twice; drop one of them")
    passed = {name: _number_or_text(value) for name, value in given.items() if name not in _EXPECTED}
    fields: dict[str, Any] = {name: value for name, value in given.items() if name in _EXPECTED}
    if "price" in fields:
        fields["price"] = fields["price"].split(":")
    try:
        return LLMSettings(name=name, effort=effort, options=passed, **asked, **fields)
    except ValidationError as error:
        first = error.errors()[0]
        wrong = str(first["loc"][0])
        if wrong == "options":  # one that may hold a key; the message names it, and not its value
            raise click.UsageError(f"--llm-option {first['msg'].removeprefix('Value error, ')}") from None
        raise click.UsageError(f"--llm-option {wrong}={given[wrong]}: {_EXPECTED[wrong]}") from None


def read_budget(options: dict[str, Any], *, asks: bool, usual: int = DEFAULT_SIMULATIONS) -> "Budget":
    """Take the values of budget_option and limit_options out of a command's keyword arguments.

    Without a maximum number of simulations, the usual one applies; ``asks``: a language model is named.

    Raises:
        click.UsageError: if a language model is limited that is not named.
    """
    from falsifier.search.budget import Budget

    simulations, seconds, tokens, cost = (options.pop(name) for name in _LIMITS)
    if not asks:
        refuse(_WITHOUT_LLM, max_tokens=tokens, max_cost=cost)
    return Budget(usual if simulations is None else simulations, seconds, tokens, cost)


def check_context(named: Sequence[str], engines: Sequence[str | None]) -> None:
    """Refuse context that nothing reads.

    Engines are those without a language model, None for the default one; none if a language model is asked.

    Raises:
        click.UsageError: naming the option.
    """
    found = (ENGINES.get(engine or DEFAULT_ENGINE) for engine in engines)
    used = [engine is None or engine.uses_context for engine in found]  # unknown names are refused later
    if set(named) - {NOTHING} and used and not any(used):
        raise click.UsageError(
            "--context: applies to language models and to the engine surrogate; add --llm NAME, or drop it"
        )


def _name_and_value(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise click.UsageError(f"--llm-option {text}: expected NAME=VALUE, for example max_tokens=4000")
    return name, value


def _number_or_text(value: str) -> str | float:
    """Return the value of an option for the provider, as a number if it is one."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(value)
    return value
