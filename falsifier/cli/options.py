"""Options of the command line, each defined once: the same name and meaning in every command that has it.

Functions that end in ``_options`` add a group of options to a command. Where commands need different defaults
or add a remark, a function makes the option.
"""

import logging
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from falsifier.cli.command import Decorator, Function, add
from falsifier.core.literals import number_in
from falsifier.engines import DEFAULT_ENGINE, ENGINES
from falsifier.search import DEFAULT_SIMULATIONS

if TYPE_CHECKING:
    from falsifier.problem.sections import ModelChanges
    from falsifier.problem.source import Parameterization, ProblemSource
    from falsifier.search.budget import Budget

PATH = click.Path(path_type=Path)

# What a search does unless it is told otherwise: the same for one run and for each run of a campaign.
DEFAULT_PARAMETERIZATION: "Parameterization" = "free"


def number(text: str) -> float:
    """Return a positive number; ValueError if it is none, which as the type of an option is a usage error."""
    if (value := number_in(text) or 0.0) > 0:
        return value
    raise ValueError(text)


class Parameterized(NamedTuple):
    """Value of ``--parameterization``."""

    profile: str | None = None  # name of a profile of the spec
    kind: "Parameterization | None" = None  # free or fixed; None if it is not stated
    shortest_piece: float | None = None  # minimum time in s between two control points of every input


def option(flag: str, name: str, text: str, *, multiple: bool, **more: Any) -> Decorator:
    """Option that some commands take once, and others repeatedly under a name in the plural."""
    if multiple:
        name, text = f"{name}s", f"{text} Repeatable."
    return click.option(flag, name, multiple=multiple, help=text, **more)


def parameterization_option(*, multiple: bool = False, default: str = DEFAULT_PARAMETERIZATION) -> Decorator:
    return option(
        "--parameterization",
        "parameterization",
        "free: engines may choose control points within the spec's limits; free:SECONDS: those of every "
        "input, at least this far apart; fixed: those of the spec. PROFILE: a profile of the spec.",
        multiple=multiple,
        metavar="[PROFILE,]free[:SECONDS]|fixed",
        type=parameterized,
        default=None if multiple else default,
        show_default=default if multiple else True,
    )


def parameterized(text: str) -> Parameterized:
    """Return what a value of ``--parameterization`` says.

    Raises:
        click.UsageError: if it says something twice, or a time is no number.

    >>> parameterized("instance2,fixed")
    Parameterized(profile='instance2', kind='fixed', shortest_piece=None)
    """
    found = Parameterized()
    for word in text.split(","):
        kind, colon, seconds = word.partition(":")
        if kind == "free" and colon:
            try:
                said: dict[str, Any] = {"kind": kind, "shortest_piece": number(seconds)}
            except ValueError:
                expected = "expected a time in s, for example free:0.5"
                raise click.UsageError(f"--parameterization {text}: {expected}") from None
        else:
            said = {"kind" if word in ("free", "fixed") else "profile": word}
        if not word or any(getattr(found, name) for name in said):
            raise click.UsageError(
                f"--parameterization {text}: expected free, free:SECONDS or fixed, after the name of a "
                "profile and a comma if the spec has profiles, for example instance2,fixed"
            )
        found = found._replace(**said)
    return found


def policy_options(command: Function) -> Function:
    """Add what FMUs may do."""
    return add(
        command,
        click.option(
            "--allow",
            multiple=True,
            metavar="write:PATH|read:PATH|programs",
            help="What the FMU may do besides changing its own folders: change PATH, read PATH even if it "
            "may contain keys, execute programs. Adds to what the spec allows. Repeatable.",
        ),
        click.option(
            "--deny",
            multiple=True,
            metavar="network",
            help="What the FMU may not do: open network connections, for example to a licence server.",
        ),
    )


def changes_in(options: dict[str, Any]) -> "ModelChanges":
    """Take out of a command's keyword arguments what changes a problem, as far as the command has it."""
    from falsifier.problem.shorthand import KEYS_WITH_OPTION, changes_from_options

    names = ("values", "ranges", *KEYS_WITH_OPTION)
    return changes_from_options(**{name: options.pop(name) for name in names if name in options})


def interface_option(text: str) -> Decorator:
    return click.option("--interface", type=click.Choice(["co-simulation", "model-exchange"]), help=text)


def stl_option(
    text: str = "Formula to use instead of the spec's requirement; or a template with its arguments, such as "
    "'settles signal=speed reference=80 within=2% time=3'.",
    **more: Any,
) -> Decorator:
    return click.option("--stl", metavar="FORMULA", help=text, **more)


def target_argument(command: Function) -> Function:
    def complete(_context: click.Context, _argument: click.Parameter, incomplete: str) -> list[Any]:
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="file")]

    return click.argument("target", shell_complete=complete)(command)


def problem_options(command: Function, *, searches: bool = True) -> Function:
    """Add the target and everything that changes a problem, except its requirement."""
    search = click.option(
        "--search",
        "ranges",
        multiple=True,
        metavar="NAME=LOW:HIGH[:POINTS[:INTERPOLATION]]",
        help="Input, parameter or start value to search. NAME=LOW:HIGH:log: a parameter in decades. NAME "
        "alone: with the spec's range, or the FMU's min and max. Repeatable.",
    )
    return add(
        command,
        target_argument,
        click.option(
            "--set",
            "values",
            multiple=True,
            metavar="NAME=VALUE",
            help="Keep an input constant, or set a parameter, start value or string. Repeatable.",
        ),
        *([search] if searches else []),
        parameterization_option(),
        interface_option(
            "FMI interface; default: the spec's, which is needed if the FMU offers both; without a spec, "
            "co-simulation if the FMU offers it."
        ),
        click.option("--stop-time", type=number, metavar="SECONDS", help="End of each simulation."),
        click.option(
            "--output-interval",
            type=number,
            metavar="SECONDS",
            help="Step of the output grid on which the requirement is monitored.",
        ),
        click.option(
            "--time-limit",
            type=number,
            metavar="SECONDS",
            help="Maximum wall-clock time of one simulation; default: the spec's, or 60 for each tenth of "
            "the simulated time.",
        ),
        click.option(
            "--omit",
            multiple=True,
            metavar="OUTPUT",
            help="Output or internal variable not to record unless a formula names it, such as one that "
            "becomes NaN. Repeatable.",
        ),
        policy_options,
    )


def requirement_options(command: Function, *, searches: bool = True) -> Function:
    """Add problem_options and the requirement."""
    return add(command, stl_option(), partial(problem_options, searches=searches))


def problem_source(options: dict[str, Any]) -> "ProblemSource":
    """Take the values of requirement_options, as far as a command has them, out of its keyword arguments.

    Raises:
        click.UsageError: if a profile is chosen from an FMU.
    """
    from falsifier.problem.loading import note_named
    from falsifier.problem.source import ProblemSource

    chosen = options.pop("parameterization")
    source = ProblemSource(
        target=options.pop("target"),
        stl=options.pop("stl"),
        profile=chosen.profile,
        parameterization=chosen.kind or DEFAULT_PARAMETERIZATION,
        shortest_piece=chosen.shortest_piece,
        changes=changes_in(options),
        context=options.pop("context", ()),
    )
    note_named(source)
    if chosen.profile is not None and source.parts.kind == "fmu":
        raise click.UsageError(
            f"--parameterization {chosen.profile}: only specs have profiles; expected free or fixed"
        )
    return source


def engine_option(*, multiple: bool = False, without: Collection[str] = ()) -> Decorator:
    """Option --engine; ``without``: the engines that ask a language model, of a command that asks none."""
    names = ", ".join(name for name in ENGINES if name not in without)
    asked = "" if without else ", or the language model if --llm is given"
    return option(
        "--engine",
        "engine",
        f"Search engine: {names}. Default: {DEFAULT_ENGINE}{asked}.",
        multiple=multiple,
        metavar="NAME",
    )


# More simulations than any machine gets through; some analyses draw all their samples first.
_MOST_SIMULATIONS = 10_000_000


def budget_option(
    default: int | None = DEFAULT_SIMULATIONS, *, least: int = 1, shown: str | None = None, note: str = ""
) -> Decorator:
    """Option --budget; shown: its default in words if that depends on other options."""
    return click.option(
        "--budget",
        type=click.IntRange(least, _MOST_SIMULATIONS),
        metavar="INTEGER",
        default=default if shown is None else None,
        show_default=True if shown is None else shown,
        help=f"Maximum number of simulations{note}.",
    )


def limit_options(*, note: str = "") -> Decorator:
    """Limits of a run in addition to --budget."""
    return lambda command: add(
        command,
        click.option("--seconds", type=number, help=f"Maximum wall-clock time in seconds{note}."),
        click.option(
            "--max-tokens", type=click.IntRange(1), help=f"Maximum number of language-model tokens{note}."
        ),
        click.option(
            "--max-cost", type=number, help=f"Maximum cost of the language model in US dollars{note}."
        ),
    )


# Limits of a campaign, each with the type of its number.
_TOTALS: dict[str, Callable[[str], float]] = {
    "simulations": int,
    "seconds": float,
    "tokens": int,
    "cost": float,
}


def _total(text: str) -> tuple[str, float]:
    name, _, limit = text.partition("=")
    try:
        return name, number(limit) and _TOTALS[name](limit)
    except (KeyError, ValueError):
        expected = ", ".join(f"{name}=N" for name in _TOTALS)
        raise click.UsageError(f"--total {text}: expected {expected} (N > 0), for example cost=5") from None


def _totals(
    _context: click.Context, _option: click.Parameter, given: Collection[tuple[str, Any]]
) -> "Budget | None":
    from falsifier.search.budget import Budget

    if len(limits := dict(given)) < len(given):
        raise click.UsageError("--total: a limit is given twice; drop one of them")
    return Budget(**{"simulations": None, **limits}) if given else None


total_option = click.option(
    "--total",
    "totals",
    multiple=True,
    metavar="|".join(f"{name}=N" for name in _TOTALS),
    type=_total,
    callback=_totals,
    help="Limit of all runs of a campaign together: simulations, seconds from this start, tokens, US "
    "dollars. What is being simulated or asked then is finished. Repeatable.",
)


def count_option(flag: str, text: str, *, default: int | None = 1, least: int = 1) -> Decorator:
    return click.option(flag, type=click.IntRange(least), default=default, show_default=True, help=text)


def seed_option(text: str = "Random seed.") -> Decorator:
    return count_option("--seed", text, default=0, least=0)


def jobs_option(what: str, *, default: int | None = 1) -> Decorator:
    return count_option("--jobs", f"Number of {what} at a time on this machine.", default=default)


def inputs_option(text: str, *, multiple: bool = False) -> Decorator:
    return option(
        "--inputs",
        "place",
        f"{text}: a CSV file (time in s, then a column for each input), a counterexample, or the best sample "
        "of a run.",
        multiple=multiple,
        type=PATH,
        metavar="u.csv|counterexample.json|RUN",
    )


run_argument = click.argument("run", metavar="RUN", type=PATH)

directory_argument = click.argument("directory", type=PATH)

requirement_option = click.option(
    "--requirement", metavar="NAME", help="Which requirement, if a run searched several."
)


def out_option(text: str, *, metavar: str = "FILE") -> Decorator:
    return click.option("-o", "--out", type=PATH, metavar=metavar, help=text)


json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")


def _silence(context: click.Context, _option: click.Parameter, quiet: bool) -> bool:  # noqa: FBT001
    """Suppress notes of the simulating processes, such as that code is compiled, until the command ends."""
    if quiet:
        logger = logging.getLogger("falsifier.fmu")
        context.call_on_close(partial(logger.setLevel, logger.level))
        logger.setLevel(logging.ERROR)
    return quiet


quiet_option = click.option("--quiet", is_flag=True, callback=_silence, help="Do not show progress.")
