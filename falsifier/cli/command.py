"""Commands: their help in groups, the check of their arguments, and how options are added to them."""

from collections import Counter
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import click
from click.core import ParameterSource

Function = Callable[..., Any]
Decorator = Callable[[Function], Function]

# Headings of --help, for commands with many options; what is in none of them belongs to the command itself.
OPTION_GROUPS = {
    "What is searched": (
        *("--stl", "--set", "--search", "--parameterization", "--interface", "--stop-time"),
        *("--output-interval", "--time-limit", "--omit", "--allow", "--deny", "--requirement"),
    ),
    "Search": ("--engine", "--inputs", "--seed", "--runs", "--jobs"),
    "Budget": ("--budget", "--seconds", "--max-tokens", "--max-cost", "--total"),
    "Language model": (
        *("--llm", "--variant", "--context", "--anonymous", "--api-base", "--llm-option"),
        "--yes",
    ),
    "Output": ("--out", "--table", "--fmu-log", "--quiet", "--json", "--help"),
}
# What to do instead of giving an option several times, if that is not only to leave one out.
_INSTEAD_OF_SEVERAL = {
    "--stl": "run one after the other, or write them to a spec as [requirements.NAME] (falsifier init "
    "MODEL.fmu begins one) and use falsifier run my.toml"
}
# From this number of options on, --help has headings.
_MANY = 12


class Command(click.Command):
    """A command whose help lists many options in groups, and that refuses empty and repeated arguments."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments.

        Raises:
            click.UsageError: if one is empty: as a path it would mean the current folder; if a number is
                none, or beyond its limits; or if an option that has one value is given several.
        """
        for before, given in zip(["", *args], args, strict=False):
            if not given or (given.startswith("--") and given.find("=") == len(given) - 1):
                name = given.removesuffix("=") or (before if before.startswith("-") else "")
                empty = f"{name}: the value is empty" if name else "an argument is empty"
                raise click.UsageError(
                    f"{empty}; expected a name, a path or a number (is a variable of the shell not set?)", ctx
                )
        try:
            for option, count in Counter(self.make_parser(ctx).parse_args(list(args))[2]).items():
                is_single = isinstance(option, click.Option) and not (option.multiple or option.is_flag)
                if count > 1 and is_single and not ctx.resilient_parsing:  # which completes words
                    instead = _INSTEAD_OF_SEVERAL.get(option.opts[-1], "give one")
                    raise click.UsageError(f"{option.opts[-1]}: given {count} times; {instead}", ctx)
            return super().parse_args(ctx, args)
        except click.BadParameter as error:
            expected = _number_text(error.param.type) if error.param else ""
            if not expected or error.param is None:
                raise
            given = error.message.partition(" is not ")[0]  # how click begins what it says of a number
            raise click.UsageError(f"{error.param.opts[-1]} {given}: expected {expected}", ctx) from None

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options below their headings."""
        for heading, rows in option_groups(self, ctx):
            with formatter.section(heading):
                formatter.write_dl(rows)


def _number_text(kind: "click.ParamType[Any]") -> str:
    """What an option of this type expects; empty if that is no number."""
    if isinstance(kind, click.IntRange):
        return f"a whole number from {kind.min}" + (" on" if kind.max is None else f" to {kind.max}")
    if kind.name == "number":
        return "a positive number"
    return {click.INT: "a whole number", click.FLOAT: "a number"}.get(kind, "")


def option_groups(command: click.Command, ctx: click.Context) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the headings of a command's options, each with the names and meanings below it."""
    options = [p for p in command.get_params(ctx) if isinstance(p, click.Option)]
    rows = {p.opts[-1]: record for p in options if (record := p.get_help_record(ctx))}
    if len(rows) < _MANY:
        return [("Options", list(rows.values()))]
    grouped = {name for names in OPTION_GROUPS.values() for name in names}
    own = [row for name, row in rows.items() if name not in grouped]
    groups = {"Options": own} | {
        heading: [row for name, row in rows.items() if name in names]
        for heading, names in OPTION_GROUPS.items()
    }
    return [(heading, group) for heading, group in groups.items() if group]


# Makes a command of a function.
command = partial(click.command, cls=Command)


def add(command: Function, *decorators: Decorator) -> Function:
    """Add options to a command; --help lists them in this order."""
    for decorate in reversed(decorators):
        command = decorate(command)
    return command


def stated(names: Collection[str]) -> list[str]:
    """Return the options that the current command was given, of those with these names of arguments."""
    context = click.get_current_context()
    return [
        parameter.opts[-1]
        for parameter in context.command.params
        if parameter.name in names
        and context.get_parameter_source(parameter.name) is not ParameterSource.DEFAULT
    ]


def refuse(reason: str, **given: object) -> None:
    """Refuse options that are given although they do not apply.

    The reason says what to do, too. None, False and an empty tuple: the option is not given.

    Raises:
        click.UsageError: naming the options.
    """
    stray = [
        f"--{name.replace('_', '-')}"
        for name, value in given.items()
        if value is not None and value is not False and value != ()
    ]
    if stray:
        raise click.UsageError(f"{', '.join(stray)}: {reason}")
