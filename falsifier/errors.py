"""All errors that the package raises on purpose.

A message names the thing that is wrong, what was expected and what to do. ``exit_code`` is the exit code of
the command line: 2 for wrong usage or a wrong file, 3 if a simulation, a language model or the machine
failed.

Who is told to state something writes options on the command line, and arguments in Python: ``written`` and
``setting`` return what this process's reader writes, as a translation returns words of the reader's language.
"""

import difflib
import errno
import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from pydantic import ValidationError

# Maximum number of characters of a rejected value in a message.
_SHOWN_INPUT = 60
# Maximum number of known names in a message: all bundled requirements fit.
_LISTED = 40
# Maximum number of characters of a message; names and values in it come from files of any size.
_LONGEST_MESSAGE = 2000
# Maximum number of characters of a name that is compared with known names, or listed.
_LONGEST_NAME = 100

# What pydantic says, by its beginning, and how we say it; {} is what follows "Input should be".
_VALIDATORS = (
    ("Input should be a valid number", "expected a number"),
    ("Input should be a valid integer", "expected a whole number"),
    ("Input should be a valid string", "expected text"),
    ("Input should be a valid boolean", "expected true or false"),
    ("Input should be a valid list", "expected a list"),
    ("Input should be a valid tuple", "expected a list"),
    ("Input should be a valid dictionary", "expected a table of keys and values"),
    ("Input should be an object", "expected a table of keys and values"),
    ("Input should be greater", "expected a number {}"),
    ("Input should be less", "expected a number {}"),
)

# What a machine has run out of, and what to do.
_EXHAUSTED = {
    errno.ENOSPC: "free some space, or choose a location on another disk",
    errno.EDQUOT: "delete files of yours, or choose a location on another disk",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f)",
    errno.ENOMEM: "free memory, or raise the limit (ulimit -v)",
    errno.EMFILE: "raise the limit on open files (ulimit -n)",
    errno.ENFILE: "the machine has too many open files: end other programs",
    errno.EAGAIN: "end other processes, or raise the limit on them (ulimit -u)",
}

FailureStatus = Literal["failed", "crashed", "timeout"]
Reader = Literal["Python", "command line"]
# Who reads what this process says.
_READERS: list[Reader] = ["Python"]


class FalsifierError(Exception):
    """Base of all errors that the package raises on purpose; messages that are too long lose their middle."""

    exit_code = 2

    def __init__(self, message: str = "") -> None:
        super().__init__(without_middle(message))


class SpecError(FalsifierError):
    """A spec file or an option is wrong; the message starts with ``file: key:`` if they are known."""

    def __init__(self, message: str, *, file: str | None = None, key: str | None = None) -> None:
        # Names in keys come from files; a message is one line.
        file, key = (part and " ".join(part.splitlines()) for part in (file, key))
        self.file = file
        self.key = key
        self.message = message
        super().__init__(": ".join(part for part in (file, key, message) if part))


@contextmanager
def in_section(file: str | None = None, key: str | None = None) -> Iterator[None]:
    """Complete errors raised within, which name only keys of this section and no file.

    Without a file, something around knows it.
    """
    try:
        yield
    except SpecError as error:
        if error.file is not None:
            raise
        keys = ".".join(part for part in (key, error.key) if part)
        raise SpecError(error.message, file=file, key=keys or None) from None


@contextmanager
def naming(place: str | None) -> Iterator[None]:
    """Let errors raised within name an option or argument, if it is to blame, in place of a spec's key."""
    try:
        yield
    except SpecError as error:
        if place is None:
            raise
        raise SpecError(error.message, file=place) from None


class FormulaError(FalsifierError):
    """A requirement's text is not exactly one STL formula, or cannot be evaluated on the given signals."""


class CandidateError(FalsifierError):
    """A candidate does not fit its search space: unknown name, wrong length, value outside its range."""


class ModelError(FalsifierError):
    """A model cannot be used at all: unreadable FMU, no binary for this platform, ..."""

    exit_code = 3


class ModelFileError(ModelError):
    """A file that is given as a model is none, such as a text that is called .fmu, or is refused."""

    exit_code = 2


class SimulationError(FalsifierError):
    """A simulation did not produce a complete trajectory.

    Attributes:
        status: ``failed`` (an error of the model, or a NaN or inf output), ``crashed`` or ``timeout``.
        time: simulated time reached, in s, if known.
        log: messages of the model during this simulation.
    """

    exit_code = 3

    def __init__(
        self,
        message: str,
        *,
        status: FailureStatus = "failed",
        time: float | None = None,
        log: tuple[str, ...] = (),
    ) -> None:
        self.status: FailureStatus = status
        self.time = time
        self.log = log
        super().__init__(message)

    def __reduce__(self) -> tuple[object, ...]:
        """Preserve the keyword arguments: exceptions are otherwise unpickled from ``args`` alone."""
        return partial(type(self), status=self.status, time=self.time, log=self.log), (str(self),)


class OutputError(SimulationError):
    """An output, or another recorded variable, cannot be read, or is NaN or inf."""


class MachineError(FalsifierError):
    """The machine does not grant what is needed."""

    exit_code = 3


class MonitorError(FalsifierError):
    """A trajectory cannot be evaluated: NaN, unequal lengths, missing signal, too short for the formula."""

    exit_code = 3


class ChatError(FalsifierError):
    """The language model could not be reached or did not give a usable reply.

    Attributes:
        lost: tokens and cost of requests that timed out or were answered in an unreadable form, a
            ``falsifier.llm.messages.Usage``; None: there were none.
    """

    exit_code = 3
    lost: Any = None


class ChatSetupError(ChatError):
    """The language model cannot be called with these settings: unknown provider, missing key."""

    exit_code = 2


class ContextExceededError(ChatError):
    """The prompt has more tokens than the LLM, or its server as it was started, takes."""


class JournalError(FalsifierError):
    """A run directory cannot be read, belongs to another problem or is in use."""


@lru_cache(maxsize=1000)
def warn_once(message: str) -> None:
    """Log a warning, however often this process looks at what it is about."""
    logging.getLogger("falsifier").warning(message)


def reader() -> Reader:
    """Return who reads what this process says."""
    return _READERS[0]


def speak_to(reader: Reader) -> None:
    """Choose who reads what this process says from now on; worker processes are told what their parent is."""
    _READERS[0] = reader


def written(option: str, argument: str) -> str:
    """Return which of the two the reader writes: an option of the command line, or an argument in Python."""
    return option if reader() == "command line" else argument


def refusal(error: OSError) -> str:
    """Say which file the operating system refused, why, and what to do about a limit of the machine."""
    return (f"{error.filename}: {error.strerror}" if error.filename else str(error)) + remedy(error)


def remedy(error: OSError) -> str:
    """Return what to do, after a semicolon, if the machine has run out of something; else an empty text."""
    return f"; {_EXHAUSTED[error.errno]}" if error.errno in _EXHAUSTED else ""


def setting(name: str, value: str = "") -> str:
    """Return how the reader names a setting that is an option and an argument of the same name, or states it.

    >>> setting("stop_time"), setting("stop_time", "SECONDS")
    ('stop_time', 'stop_time=SECONDS')
    """
    option = f"--{name.replace('_', '-')}"
    return written(f"{option} {value}", f"{name}={value}") if value else written(option, name)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of an error message: the most similar known name, if any, and the known names.

    >>> did_you_mean("sped", ["rpm", "speed"])
    "did you mean 'speed'? Known: rpm, speed"
    >>> did_you_mean("altitude", ["rpm", "speed"])
    'known: rpm, speed'
    """
    name = name[:_LONGEST_NAME]
    names = list(dict.fromkeys(without_middle(other, _LONGEST_NAME) for other in known))
    shown = [*names[:_LISTED], *(["..."] if len(names) > _LISTED else [])]
    listing = f"known: {', '.join(shown) or 'none'}"
    # Also names that differ in the case of letters only.
    folded = {other.casefold(): other for other in reversed(names)}
    similar = partial(difflib.get_close_matches, n=1, cutoff=0.6 if len(name) > 2 else 0.5)
    near = similar(name, names) or [folded[n] for n in similar(name.casefold(), folded)]
    found = folded.get(name.casefold()) or next(iter(near), None)
    return f"did you mean {found!r}? K{listing[1:]}" if found else listing


def without_middle(text: str, most: int = _LONGEST_MESSAGE) -> str:
    """Return a text of at most about so many characters: its beginning and its end."""
    return text if len(text) <= most else f"{text[: most - most // 4]} ... {text[-most // 4 :]}"


def rejected(message: str, given: object) -> str:
    """Return a validator's message in our words, with the rejected value if it states only what was expected.

    >>> rejected("Input should be 'free' or 'fixed'", "fixd")
    "expected 'free' or 'fixed', got 'fixd'"
    """
    message = message.removeprefix("Value error, ")
    if sizes := re.fullmatch(
        r"\w+ should have at (least|most) (\d+) items? after validation, not (\d+)", message
    ):
        return f"expected at {sizes[1]} {sizes[2]} items, got {sizes[3]}"
    if message == "Field required":
        return "a value is missing"
    if not message.startswith("Input should"):
        return message
    message = next((own for begin, own in _VALIDATORS if message.startswith(begin)), "expected {}").format(
        message.partition(" be ")[2] or message
    )
    return f"{message}, got {shown(given)}"


def shown(given: object) -> str:
    """Return a rejected value as a file has it; a long one without its end."""
    text = str(given).lower() if isinstance(given, bool) else repr(given)
    return text if len(text) <= _SHOWN_INPUT else f"{text[:_SHOWN_INPUT]} ..."


def first_fault(error: "ValidationError") -> tuple[str, str]:
    """Return the key of the first thing that pydantic has found wrong, and what is wrong in our words."""
    first = error.errors()[0]
    return key_of(first["loc"]), rejected(first["msg"], first["input"])


def key_of(location: Iterable[str | int]) -> str:
    """Return the key at a location in nested tables and lists.

    >>> key_of(("inputs", "u", "range", 1))
    'inputs.u.range, entry 2'
    """
    return "".join(f", entry {p + 1}" if isinstance(p, int) else f".{p}" for p in location).lstrip("., ")
