"""What was read of the files that a user named, as it is told and recorded."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Excerpt:
    """What is told of one file.

    Attributes:
        path: the file as it was named; of one inside an FMU, ``my.fmu: sources/model.c``.
        name: the file as it is told: without the folders of this machine.
        sha256: hash of the file's content.
        form: what is told of it, in words: ``whole``, ``structure``, ...
        text: what is told.
    """

    path: str
    name: str
    sha256: str
    form: str
    text: str


@dataclass(frozen=True, slots=True)
class Compared:
    """One comparison with a constant, or what else the files say of a signal in one line.

    Attributes:
        signals: the model's signals in it, by their names there; empty if it is about other variables.
        text: the comparison, with the values of named constants.
        place: file and line, or block.
    """

    signals: tuple[str, ...]
    text: str
    place: str


@dataclass(frozen=True, slots=True)
class Context:
    """What the named files say of a model.

    Attributes:
        excerpts: what is told of each file.
        comparisons: thresholds, signals of the model first.
    """

    excerpts: tuple[Excerpt, ...] = ()
    comparisons: tuple[Compared, ...] = ()

    def of(self, signal: str) -> tuple[str, ...]:
        """Return what is known of one signal of the model."""
        return tuple(c.text for c in self.comparisons if signal in c.signals)


@dataclass(frozen=True, slots=True)
class Named:
    """What a user named as context; nothing of it has been read.

    Attributes:
        files: paths of files.
        fmu: whether to look inside the model's FMUs.
    """

    files: tuple[str, ...] = ()
    fmu: bool = False

    def __bool__(self) -> bool:
        return bool(self.files) or self.fmu
