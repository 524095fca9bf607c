"""What goes to stderr: plain text only, and a terminal or pipe that is gone never ends a run."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TypeVar

from falsifier.core.literals import plain
from falsifier.core.secrets import redact

if TYPE_CHECKING:
    from rich.console import Console
    from rich.live import Live
    from rich.progress import Progress

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
def moving(live: "Live | Progress") -> Iterator[None]:
    """Keep a display moving for as long as the context lasts."""
    with suppress(OSError):
        live.start()
    try:
        yield
    finally:
        with suppress(OSError):
            live.stop()
