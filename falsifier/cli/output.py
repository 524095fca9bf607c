"""Printing results on stdout; messages for people go to stderr through ``views.terminal``."""

import sys
from typing import NoReturn

import click

from falsifier.core.literals import plain
from falsifier.views.terminal import warn


def say(text: str, *, nl: bool = True) -> None:
    """Print a result, without control characters.

    Raises:
        OSError: if stdout cannot be written to.
    """
    click.echo(plain(text), nl=nl)


def conclude(text: str, code: int, *, nl: bool = True) -> NoReturn:
    """Print a result and end with its exit code, whether or not it can be printed."""
    try:
        say(text, nl=nl)
    except OSError as error:
        warn(f"falsifier: the result cannot be printed: {error.strerror or error}")
    sys.exit(code)
