"""What was read of the files that a user named, as it is told and recorded."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

# Endings of Simulink files.
SIMULINK = (".slx", ".mdl")
# What --context takes beside files, and what it begins with if a file is allowed.
INSIDE, NOTHING, CHECKED = "fmu", "none", "checked:"


@dataclass(frozen=True, slots=True)
class Excerpt:
    """What is told of one file."""

    path: str  # as it was named; of one inside an FMU, my.fmu: sources/model.c
    name: str  # as it is told: without the folders of this machine
    sha256: str
    form: str  # what is told of it, in words: whole, structure, ...
    text: str


@dataclass(frozen=True, slots=True)
class Compared:
    """One comparison with a constant, or what else the files say of a signal in one line."""

    signals: tuple[str, ...]  # by their names in the model; empty if it is about other variables
    text: str  # with the values of named constants


@dataclass(frozen=True, slots=True)
class Crossing:
    """A value of an input or parameter, in its unit, at which a comparison in a file changes."""

    signal: str
    value: float


@dataclass(frozen=True, slots=True)
class Context:
    """What the named files say of a model."""

    excerpts: tuple[Excerpt, ...] = ()
    comparisons: tuple[Compared, ...] = ()  # those of signals of the model first
    crossings: tuple[Crossing, ...] = ()  # engines may try these
    notes: tuple[str, ...] = ()  # not told, but for the user: files left out, lines allowed

    def of(self, signal: str) -> tuple[str, ...]:
        """Return what is known of one signal of the model."""
        return tuple(c.text for c in self.comparisons if signal in c.signals)


@dataclass(frozen=True, slots=True)
class Named:
    """What a user named as context; nothing of it has been read."""

    files: tuple[str, ...] = ()
    fmu: bool = False  # whether to look inside the model's FMUs
    checked: tuple[str, ...] = ()  # files with a line that looks like a secret and is none

    def __bool__(self) -> bool:
        return bool(self.files) or self.fmu or bool(self.checked)

    @classmethod
    def of(cls, names: Iterable[str]) -> Self:
        """Return what the values of ``--context`` name.

        >>> Named.of(["a.mo", "fmu", "checked:a.mo"])
        Named(files=('a.mo',), fmu=True, checked=('a.mo',))
        """
        listed = dict.fromkeys(names)
        return cls(
            tuple(n for n in listed if n not in (INSIDE, NOTHING) and not n.startswith(CHECKED)),
            INSIDE in listed,
            tuple(n.removeprefix(CHECKED) for n in listed if n.startswith(CHECKED)),
        )
