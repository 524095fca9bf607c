"""Options of the command line, each defined once: the same name and help in every command that has it.

Functions that end in ``_options`` add a group of options to a command. Where commands need different defaults
or add a remark, a function makes the option.
"""

import logging
import math
from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, get_args

import click

from falsifier.context.values import NOTHING
from falsifier.core.secrets import is_secret_option
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.llm.messages import ReplyKind
from falsifier.llm.prompts.variants import CONTEXT_VARIANT, DEFAULT_VARIANT
from falsifier.problem.shorthand import changes_from_options
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.search.budget import DEFAULT_SECONDS, DEFAULT_SIMULATIONS
from falsifier.search.request import Effort, LLMSettings

# What a price is, in errors; as providers state prices.
_PRICE = "expected SENT:RECEIVED in US dollars per million tokens sent and received, for example 0.25:2"

Function = Callable[..., Any]
Decorator = Callable[[Function], Function]


def _add(command: Function, *decorators: Decorator) -> Function:
    """Add options to a command; --help lists them in this order."""
    for decorate in reversed(decorators):
        command = decorate(command)
    return command


def profile_option(command: Function) -> Function:
    return click.option(
        "--profile", metavar="NAME", help="Named parameterization that the spec offers, e.g. instance2."
    )(command)


# What a search does unless it is told otherwise: the same for one run and for each run of a campaign.
DEFAULT_PARAMETERIZATION: Parameterization = "free"


def parameterization_option(*, multiple: bool = False, suite: Parameterization = "fixed") -> Decorator:
    default = DEFAULT_PARAMETERIZATION
    return click.option(
        "--parameterization",
        type=click.Choice(["free", "fixed"]),
        multiple=multiple,
        default=() if multiple else default,
        show_default=f"{default}; with --suite {suite}" if multiple else True,
        help=_repeatable(
            "free: engines may choose control points within the spec's limits; fixed: the spec's own.",
            multiple=multiple,
        ),
    )


def template_option(command: Function) -> Function:
    return click.option(
        "--template",
        multiple=True,
        callback=_only_one,
        metavar="'NAME KEY=VALUE ...'",
        help="Template in place of a formula, e.g. 'settles signal=speed reference=80 within=2% time=3'.",
    )(command)


def problem_options(command: Function) -> Function:
    """Add the target and everything that changes a problem."""
    return _add(
        command,
        click.argument("target"),
        click.option(
            "--stl",
            multiple=True,  # so that a second one is an error and does not silently replace the first
            callback=_only_one,
            metavar="FORMULA",
            help="Formula to use instead of the spec's requirement.",
        ),
        template_option,
        profile_option,
        parameterization_option(),
        click.option(
            "--free",
            "shortest_piece",
            type=float,
            metavar="SECONDS",
            help="Free parameterization of every input, with pieces at least this long; default: the spec's "
            "limits, or some derived from the formula's windows.",
        ),
        click.option(
            "--interface",
            type=click.Choice(["co-simulation", "model-exchange"]),
            help="FMI interface to simulate; default: the spec's, or co-simulation if the FMU offers it.",
        ),
        click.option(
            "--input",
            "inputs",
            multiple=True,
            metavar="NAME=LOW:HIGH[:POINTS[:INTERPOLATION]]",
            help="Input signal to search. NAME alone: with the spec's range, or between the FMU's min and "
            "max. NAME=VALUE: keep it constant. Repeatable.",
        ),
        click.option(
            "--param",
            "parameters",
            multiple=True,
            metavar="NAME=VALUE",
            help="Parameter, start value or string to set. NAME=LOW:HIGH: search it. Repeatable.",
        ),
        click.option("--stop-time", type=float, metavar="SECONDS", help="End of each simulation."),
        click.option(
            "--output-interval",
            type=float,
            metavar="SECONDS",
            help="Step of the output grid on which the requirement is monitored.",
        ),
        click.option(
            "--time-limit",
            type=float,
            metavar="SECONDS",
            help="Maximum wall-clock time of one simulation; default: the spec's, or 60.",
        ),
    )


def _only_one(_context: click.Context, option: click.Parameter, formulas: tuple[str, ...]) -> str | None:
    if len(formulas) > 1:
        raise click.UsageError(
            f"--{option.name}: given {len(formulas)} times; run one after the other, or write them to a spec "
            "as [requirements.NAME] (falsifier init MODEL.fmu begins one) and use falsifier run my.toml --all"
        )
    return formulas[0] if formulas else None


def problem_source(options: dict[str, Any]) -> ProblemSource:
    """Take the values of problem_options out of a command's keyword arguments."""
    varied = ("inputs", "parameters", "stop_time", "output_interval", "time_limit", "interface")
    changes = changes_from_options(**{name: options.pop(name) for name in varied})
    context = options.pop("context", ())
    stated = {
        name: options.pop(name) for name in ("target", "stl", "profile", "parameterization", "shortest_piece")
    }
    source = ProblemSource(**stated, changes=changes, context=context)
    template = options.pop("template")
    if template is not None and source.stl is not None:
        raise click.UsageError("--stl and --template both state the requirement; drop one of them")
    return with_template(source, template)


def with_template(source: ProblemSource, template: str | None) -> ProblemSource:
    """Return a source with the formula of ``--template``, if that is given."""
    if template is None:
        return source
    from falsifier.problem.template_option import formula_of_template

    return source.model_copy(update={"stl": formula_of_template(source, template)})


def engine_option(*, multiple: bool = False) -> Decorator:
    return click.option(
        "--engine",
        "engines" if multiple else "engine",
        multiple=multiple,
        metavar="NAME",
        help=_repeatable(
            f"Search engine: {', '.join(ENGINES)}. Default: {DEFAULT_ENGINE}, or the language model if "
            "--llm is given.",
            multiple=multiple,
        ),
    )


def llm_option(*, multiple: bool = False) -> Decorator:
    text = "Language model, e.g. openai/gpt-5-mini or ollama_chat/gpt-oss:20b."
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
        help=_repeatable(
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
    return _add(
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
    return _add(
        command,
        connection_options,
        anonymous_option,
        reply_option,
        click.option("--fallback", metavar="ENGINE", help="Engine to switch to if the language model fails."),
    )


def llm_options(command: Function) -> Function:
    """Add which language model to ask, and how."""
    return _add(command, llm_option(), effort_option, variant_option(), asking_options)


def connection_settings(options: dict[str, Any]) -> LLMSettings | None:
    """Take the values of llm, effort and connection_options out of a command's keyword arguments."""
    unused = {"variant": None, "fallback": None, "anonymous": False, "reply": None}
    options.update(unused)
    return llm_settings(options)


def llm_settings(options: dict[str, Any]) -> LLMSettings | None:
    """Take the values of llm_options out of a command's keyword arguments; None if no LLM is named."""
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
    if not all(math.isfinite(price) and price >= 0 for price in (sent, received)):
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
    try:
        return name, int(value) if value.isdigit() else float(value)
    except ValueError:
        return name, value


def budget_option(
    default: int = DEFAULT_SIMULATIONS, *, shown: str | None = None, note: str = ""
) -> Decorator:
    """Option --budget; shown: its default in words if that depends on other options."""
    return click.option(
        "--budget",
        type=int,
        default=default if shown is None else None,
        show_default=True if shown is None else shown,
        help=f"Maximum number of simulations{note}.",
    )


def objective_option(command: Function) -> Function:
    return click.option(
        "--objective",
        type=click.Choice(["simulations", "time"]),
        help="What to keep small: with time, cheap proposals are simulated while the engine thinks or beside "
        f"it, and without limits the run ends after {DEFAULT_SECONDS:g} s. Default: simulations.",
    )(command)


def limit_options(*, note: str = "") -> Decorator:
    """Limits of a run in addition to --budget."""
    return lambda command: _add(
        command,
        click.option("--seconds", type=float, help=f"Maximum wall-clock time in seconds{note}."),
        click.option("--max-tokens", type=int, help=f"Maximum number of language-model tokens{note}."),
        click.option(
            "--max-cost", type=float, help=f"Maximum cost of the language model in US dollars{note}."
        ),
    )


def total_options(command: Function) -> Function:
    """Add the limits of a campaign."""
    return _add(
        command,
        click.option("--total-budget", type=int, help="Maximum number of simulations of all runs together."),
        click.option(
            "--total-seconds", type=float, help="Maximum wall-clock time in seconds, counted from this start."
        ),
        click.option(
            "--total-tokens", type=int, help="Maximum number of language-model tokens of all runs together."
        ),
        click.option(
            "--total-cost",
            type=float,
            help="Maximum cost of the language models in US dollars of all runs together.",
        ),
    )


def seed_option(text: str = "Random seed.") -> Decorator:
    return click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help=text)


def jobs_option(what: str) -> Decorator:
    return click.option(
        "--jobs",
        type=click.IntRange(1),
        default=1,
        show_default=True,
        help=f"Number of {what} at a time on this machine.",
    )


def executor_option(command: Function) -> Function:
    return click.option(
        "--executor",
        metavar="dask:tcp://HOST:PORT",
        help="Run on a Dask cluster instead of this machine. Workers without access to DIR notice the "
        "--total-... limits only between runs.",
    )(command)


def start_from_option(command: Function) -> Function:
    return click.option(
        "--start-from",
        type=click.Path(path_type=Path),
        multiple=True,
        metavar="u.csv|counterexample.json|RUN",
        help="Known inputs to simulate first: a CSV file, a counterexample, or the best sample of a run. "
        "They count in the budget, and the engine learns from them. Repeatable.",
    )(command)


def run_argument(command: Function) -> Function:
    return click.argument("run", metavar="RUN", type=click.Path(path_type=Path))(command)


def directory_argument(command: Function) -> Function:
    return click.argument("directory", type=click.Path(path_type=Path))(command)


def out_option(text: str, *, metavar: str = "FILE") -> Decorator:
    return click.option("-o", "--out", type=click.Path(path_type=Path), metavar=metavar, help=text)


def store_option(command: Function) -> Function:
    return click.option(
        "--store",
        type=click.Path(path_type=Path),
        metavar="DIR",
        help="Also store the counterexample in this folder of counterexamples.",
    )(command)


def json_option(command: Function) -> Function:
    return click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")(
        command
    )


def quiet_option(command: Function) -> Function:
    return click.option(
        "--quiet",
        is_flag=True,
        callback=lambda context, _option, quiet: _silence(context, quiet=quiet),
        help="Do not show progress.",
    )(command)


def _silence(context: click.Context, *, quiet: bool) -> bool:
    """Suppress notes of the simulating processes, such as that code is compiled, until the command ends."""
    if quiet:
        logger = logging.getLogger("falsifier.fmu")
        context.call_on_close(partial(logger.setLevel, logger.level))
        logger.setLevel(logging.ERROR)
    return quiet


def _repeatable(text: str, *, multiple: bool) -> str:
    return f"{text} Repeatable." if multiple else text
