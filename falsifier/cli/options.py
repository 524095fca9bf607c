"""Options that bear the same names in every command."""

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import click

from falsifier.core.secrets import is_secret_option
from falsifier.problem.options import changes_from_options
from falsifier.problem.source import ProblemSource
from falsifier.search.request import LLMSettings

F = TypeVar("F", bound=Callable[..., Any])


def problem_options(command: F) -> F:
    """Add the target and everything that changes a problem."""
    for decorate in reversed(
        (
            click.argument("target"),
            click.option("--stl", metavar="FORMULA", help="Judge this formula instead of the spec's."),
            click.option("--profile", help="Another parameterization that the spec offers, e.g. instance2."),
            click.option(
                "--parameterization",
                type=click.Choice(["free", "fixed"]),
                default="free",
                show_default=True,
                help="free: control points within the spec's limits; fixed: only the spec's own.",
            ),
            click.option(
                "--interface",
                type=click.Choice(["co-simulation", "model-exchange"]),
                help="How the FMU is simulated.",
            ),
            click.option(
                "--input",
                "inputs",
                multiple=True,
                metavar="NAME=LOW:HIGH:POINTS",
                help="Search this input signal (NAME alone: as the spec says, or between the FMU's min and "
                "max; NAME=VALUE: keep it constant). Repeatable.",
            ),
            click.option(
                "--param",
                "parameters",
                multiple=True,
                metavar="NAME=VALUE",
                help="Set a parameter, start value or string (or NAME=LOW:HIGH: search it). Repeatable.",
            ),
            click.option("--stop-time", type=float, metavar="SECONDS", help="End of each simulation."),
            click.option(
                "--output-interval", type=float, metavar="SECONDS", help="Step of the monitored grid."
            ),
            click.option(
                "--time-limit",
                type=float,
                metavar="SECONDS",
                help="Longest time that one simulation may take.",
            ),
        )
    ):
        command = decorate(command)
    return command


def problem_source(options: dict[str, Any]) -> ProblemSource:
    """Take the problem's options out of a command's keyword arguments."""
    varied = ("inputs", "parameters", "stop_time", "output_interval", "time_limit", "interface")
    changes = changes_from_options(**{name: options.pop(name) for name in varied})
    stated = {name: options.pop(name) for name in ("target", "stl", "profile", "parameterization")}
    return ProblemSource(**stated, changes=changes)


def llm_options(command: F) -> F:
    """Add everything that says which language model is asked, and how."""
    for decorate in reversed(
        (
            click.option(
                "--llm",
                metavar="NAME",
                help="Language model, e.g. openai/gpt-5-mini, ollama_chat/gpt-oss:20b.",
            ),
            click.option(
                "--effort", type=click.Choice(["low", "medium", "high"]), help="Its reasoning effort."
            ),
            click.option("--variant", metavar="MP1..", help="Prompt variant."),
            asking_options,
        )
    ):
        command = decorate(command)
    return command


def asking_options(command: F) -> F:
    """Add how language models are asked, whichever they are."""
    for decorate in reversed(
        (
            click.option("--api-base", metavar="URL", help="Address of an OpenAI-compatible server."),
            click.option(
                "--llm-option",
                "llm_options",
                multiple=True,
                metavar="NAME=VALUE",
                help="Passed to the provider as it is, e.g. max_tokens=4000. Repeatable.",
            ),
            click.option(
                "--price",
                metavar="SENT:RECEIVED",
                help="US dollars for 1000 tokens, where the price is not known.",
            ),
            click.option("--anonymous", is_flag=True, help="Tell the LLM neutral names only."),
            click.option("--fallback", metavar="ENGINE", help="Engine that goes on when the LLM gives up."),
            click.option("--no-cache", is_flag=True, help="Ask anew where the reply is already on disk."),
        )
    ):
        command = decorate(command)
    return command


def llm_settings(options: dict[str, Any]) -> LLMSettings | None:
    """Take the LLM's options out of a command's keyword arguments; None where no LLM is named."""
    name = options.pop("llm")
    asked = {key: options.pop(key) for key in ("effort", "variant")}
    asked |= asking(options, named=name is not None)
    if name is None:
        _refuse_without_llm(asked)
        return None
    return LLMSettings(name=name, **asked)


def asking(options: dict[str, Any], *, named: bool) -> dict[str, Any]:
    """Take the values of asking_options out of a command's keyword arguments, as fields of LLMSettings.

    Raises:
        click.UsageError: where one cannot be read, or one is given and no model is named.
    """
    given = {key: options.pop(key) for key in ("api_base", "fallback", "anonymous")}
    price, pairs = options.pop("price"), options.pop("llm_options")
    cache = not options.pop("no_cache")
    if not named:
        _refuse_without_llm(given | {"price": price, "llm_option": pairs})
    return given | {"price": _price(price), "options": dict(map(_llm_option, pairs)), "cache": cache}


def _refuse_without_llm(given: dict[str, Any]) -> None:
    stray = [f"--{key.replace('_', '-')}" for key, value in given.items() if value and key != "cache"]
    if stray:
        raise click.UsageError(f"{', '.join(stray)}: only a language model takes this; you need --llm NAME")


def _price(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        sent, received = (float(part) for part in text.split(":"))
    except ValueError:
        raise click.UsageError(f"--price {text}: expected SENT:RECEIVED, for example 0.25:2") from None
    return sent, received


def _llm_option(text: str) -> tuple[str, str | float]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise click.UsageError(f"--llm-option {text}: expected NAME=VALUE, for example max_tokens=4000")
    if is_secret_option(name):  # options stand in the run's manifest
        raise click.UsageError(f"--llm-option {name}: keys are read from the environment only")
    try:
        return name, int(value) if value.isdigit() else float(value)
    except ValueError:
        return name, value


def out_option(command: F) -> F:
    """Add --out."""
    return click.option(
        "--out",
        type=click.Path(path_type=Path),
        metavar="DIR",
        help="Run directory; default: runs/NAME-TIME.",
    )(command)


def json_option(command: F) -> F:
    """Add --json."""
    return click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")(
        command
    )


def quiet_option(command: F) -> F:
    """Add --quiet."""
    return click.option(
        "--quiet",
        is_flag=True,
        callback=lambda context, _option, quiet: _silence(context, quiet=quiet),
        help="No progress.",
    )(command)


def _silence(context: click.Context, *, quiet: bool) -> bool:
    """Have simulating processes keep to themselves that they compile, as long as the command runs."""
    if quiet:
        logger = logging.getLogger("falsifier.fmu")
        context.call_on_close(partial(logger.setLevel, logger.level))
        logger.setLevel(logging.ERROR)
    return quiet
