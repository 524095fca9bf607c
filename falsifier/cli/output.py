"""What the command line prints, and the standard streams, whatever state they were handed over in.

Results go to stdout; messages for people go to stderr through ``views.terminal``.
"""

import json
import os
import signal
import sys
from contextlib import suppress
from time import monotonic
from types import FrameType
from typing import NoReturn

import click

from falsifier.core.literals import plain
from falsifier.views.terminal import warn

FAILED, INTERRUPTED = 3, 130
_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# In s; a signal that follows the first one this soon is the same one, as ``timeout`` sends it to the command
# and to its group. Ctrl-C is different: who presses it twice is impatient.
_SAME = 1.0
_INTERRUPTED_AT: list[float] = []
# Moving displays hide the cursor of the terminal.
_SHOW_CURSOR = b"\x1b[?25h\n"


def say(text: str, *, nl: bool = True) -> None:
    """Print a result, without control characters; OSError if stdout cannot be written to."""
    click.echo(plain(text), nl=nl)


def as_shown(text: str, content: object, *, as_json: bool) -> str:
    """Return a result as text, or its content as JSON."""
    return json.dumps(content, indent=2) if as_json else text


def conclude(text: str, code: int, *, nl: bool = True) -> NoReturn:
    """Print a result and end with its exit code, whether or not it can be printed."""
    try:
        say(text, nl=nl)
    except OSError as error:
        warn(f"falsifier: the result cannot be printed: {error.strerror or error}")
    sys.exit(code)


def open_streams() -> None:
    """Make all three streams usable.

    A closed one is replaced: otherwise the next file that is opened, such as a journal, would take its place
    and receive what is printed. Characters that the terminal's encoding lacks are written as escapes.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # It takes the lowest free number, which is this one, and is a stream of child processes, too.
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # noqa: FBT003
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, "w", encoding="utf-8", closefd=False))  # noqa: SIM115
        with suppress(AttributeError):
            getattr(sys, name).reconfigure(errors="backslashreplace")


def settle_streams() -> None:
    """Write what is left; what cannot be written is dropped, or Python would end with another exit code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def stop_at_interrupts() -> None:
    """Let the first Ctrl-C, or end of a job or session, stop the command in good order, the next at once."""
    for number in _STOPPING:
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):  # a shell may ignore it
            signal.signal(number, _interrupt)


def end_at_interrupts(code: int) -> None:
    """Let Ctrl-C end the program at once with this exit code, which is settled."""
    for number in _STOPPING:
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, lambda _signal, _frame: os._exit(code))


def _interrupt(number: int, _frame: FrameType | None) -> None:
    if not _INTERRUPTED_AT:
        _INTERRUPTED_AT.append(monotonic())
        raise KeyboardInterrupt
    if number != signal.SIGINT and monotonic() - _INTERRUPTED_AT[-1] < _SAME:
        return
    with suppress(OSError):
        if os.isatty(2):
            os.write(2, _SHOW_CURSOR)
    os._exit(INTERRUPTED)
