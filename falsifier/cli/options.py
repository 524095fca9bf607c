"""Options that bear the same names in every command."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from falsifier.request import ProblemRequest

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
                help="Search this input signal (or NAME=VALUE: keep it constant). Repeatable.",
            ),
            click.option(
                "--param",
                "parameters",
                multiple=True,
                metavar="NAME=VALUE",
                help="Set a parameter or start value (or NAME=LOW:HIGH: search it). Repeatable.",
            ),
            click.option("--stop-time", type=float, metavar="SECONDS", help="End of each simulation."),
            click.option(
                "--output-interval", type=float, metavar="SECONDS", help="Step of the monitored grid."
            ),
        )
    ):
        command = decorate(command)
    return command


def problem_request(options: dict[str, Any]) -> ProblemRequest:
    """Take the problem's options out of a command's keyword arguments."""
    return ProblemRequest(**{name: options.pop(name) for name in ProblemRequest.model_fields})


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
    return click.option("--quiet", is_flag=True, help="No progress.")(command)
