"""Options of the command line, each defined once: the same name and help in every command that has it.

Functions that end in ``_options`` add a group of options to a command. Where commands need different defaults
or add a remark, a function makes the option.
"""

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.search.budget import DEFAULT_SIMULATIONS

if TYPE_CHECKING:
    from falsifier.problem.sections import ModelChanges
    from falsifier.problem.source import Parameterization, ProblemSource

Function = Callable[..., Any]
Decorator = Callable[[Function], Function]


def add(command: Function, *decorators: Decorator) -> Function:
    """Add options to a command; --help lists them in this order."""
    for decorate in reversed(decorators):
        command = decorate(command)
    return command


def profile_option(command: Function) -> Function:
    return click.option(
        "--profile", metavar="NAME", help="Named parameterization that the spec offers, e.g. instance2."
    )(command)


# What a search does unless it is told otherwise: the same for one run and for each run of a campaign.
DEFAULT_PARAMETERIZATION: "Parameterization" = "free"


def parameterization_option(*, multiple: bool = False, suite: "Parameterization" = "fixed") -> Decorator:
    default = DEFAULT_PARAMETERIZATION
    return click.option(
        "--parameterization",
        type=click.Choice(["free", "fixed"]),
        multiple=multiple,
        default=() if multiple else default,
        show_default=f"{default}; with --suite {suite}" if multiple else True,
        help=repeatable(
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


def policy_options(command: Function) -> Function:
    """Add what FMUs may do."""
    return add(
        command,
        click.option(
            "--allow",
            multiple=True,
            metavar="write:PATH|read:PATH|programs",
            help="What the FMU may do beyond changing its own folders: change PATH, read PATH although it "
            "may hold keys, execute programs. In addition to the spec's. Repeatable.",
        ),
        click.option(
            "--deny",
            multiple=True,
            metavar="network",
            help="What the FMU may not do: open network connections, for example to a licence server.",
        ),
    )


def policy_changes(options: dict[str, Any]) -> "ModelChanges":
    """Take the values of policy_options out of a command's keyword arguments."""
    from falsifier.problem.shorthand import changes_from_options

    return changes_from_options(allow=options.pop("allow"), deny=options.pop("deny"))


def problem_options(command: Function) -> Function:
    """Add the target and everything that changes a problem."""
    return add(
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
        interface_option("FMI interface; default: the spec's, or co-simulation if the FMU offers it."),
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
            help="Maximum wall-clock time of one simulation; default: the spec's, or 60 for each tenth of "
            "the simulated time.",
        ),
        policy_options,
    )


def _only_one(_context: click.Context, option: click.Parameter, formulas: tuple[str, ...]) -> str | None:
    if len(formulas) > 1:
        raise click.UsageError(
            f"--{option.name}: given {len(formulas)} times; run one after the other, or write them to a spec "
            "as [requirements.NAME] (falsifier init MODEL.fmu begins one) and use falsifier run my.toml --all"
        )
    return formulas[0] if formulas else None


def problem_source(options: dict[str, Any]) -> "ProblemSource":
    """Take the values of problem_options out of a command's keyword arguments."""
    from falsifier.problem.shorthand import changes_from_options
    from falsifier.problem.source import ProblemSource

    varied = (
        *("inputs", "parameters", "stop_time", "output_interval", "time_limit", "interface"),
        *("allow", "deny"),
    )
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


def with_template(source: "ProblemSource", template: str | None) -> "ProblemSource":
    """Return a source with the formula of ``--template``, if that is given."""
    if template is None:
        return source
    from falsifier.problem.loading import formula_of_template

    return source.model_copy(update={"stl": formula_of_template(source, template)})


def engine_option(*, multiple: bool = False) -> Decorator:
    return click.option(
        "--engine",
        "engines" if multiple else "engine",
        multiple=multiple,
        metavar="NAME",
        help=repeatable(
            f"Search engine: {', '.join(ENGINES)}. Default: {DEFAULT_ENGINE}, or the language model if "
            "--llm is given.",
            multiple=multiple,
        ),
    )


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


def limit_options(*, note: str = "") -> Decorator:
    """Limits of a run in addition to --budget."""
    return lambda command: add(
        command,
        click.option("--seconds", type=float, help=f"Maximum wall-clock time in seconds{note}."),
        click.option("--max-tokens", type=int, help=f"Maximum number of language-model tokens{note}."),
        click.option(
            "--max-cost", type=float, help=f"Maximum cost of the language model in US dollars{note}."
        ),
    )


def total_options(command: Function) -> Function:
    """Add the limits of a campaign."""
    return add(
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


def interface_option(text: str) -> Decorator:
    return click.option("--interface", type=click.Choice(["co-simulation", "model-exchange"]), help=text)


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


def repeatable(text: str, *, multiple: bool) -> str:
    """Return the help of an option, which says if it may be given several times."""
    return f"{text} Repeatable." if multiple else text
