"""What goes to stderr: plain text only, and a terminal or pipe that is gone never ends a run."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TypeVar

from falsifier.core.literals import one_line, plain
from falsifier.core.secrets import redact

if TYPE_CHECKING:
    from rich.console import Console

T = TypeVar("T")


def warn(text: str) -> None:
    """Print a message for people on stderr, without secrets, if that can be written to."""
    with suppress(OSError):
        print(plain(redact(text)), file=sys.stderr, flush=True)


def error_console() -> "Console":
    """Return rich's console on stderr."""
    from rich.console import Console

    class ErrorConsole(Console):
        def on_broken_pipe(self) -> None:
            raise  # rich itself would end the program with 1, the code of a falsification

    return ErrorConsole(stderr=True)


def line_writer(console: "Console") -> Callable[[str], None]:
    """Return what prints a text as one plain line."""
    return lambda text: console.print(
        one_line(text), highlight=False, markup=False, soft_wrap=not console.is_terminal
    )


def unbroken(show: Callable[[T], None]) -> Callable[[T], None]:
    """Return a display that falls silent when its stream can no longer be written to."""
    silent = False

    def show_if_possible(shown: T) -> None:
        nonlocal silent
        if silent:
            return
        try:
            show(shown)
        except OSError:
            silent = True

    return show_if_possible


@contextmanager
def live_line(console: "Console") -> Iterator[Callable[[str], None]]:
    """Show a line below everything else for as long as the context lasts; yield what replaces its text."""
    from rich.status import Status
    from rich.text import Text

    status = Status("", console=console)
    with suppress(OSError):
        status.start()
    try:
        yield lambda text: status.update(Text(one_line(text), no_wrap=True, overflow="ellipsis"))
    finally:
        with suppress(OSError):
            status.stop()
