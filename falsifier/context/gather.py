"""Reads what a user named as context, refuses secrets, and tells as much of each file as fits."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import accumulate
from os.path import realpath
from pathlib import Path
from types import MappingProxyType

from falsifier.context.excerpts import Readable, of_diagram, of_source, of_text
from falsifier.context.files import NAME_THEM, Sentry, inside, text_of
from falsifier.context.simulink import Diagram, read_diagram
from falsifier.context.simulink.sections import read_parts
from falsifier.context.sources import Source, read_source
from falsifier.context.thresholds import Threshold
from falsifier.context.values import SIMULINK, Compared, Context, Crossing, Excerpt
from falsifier.core.words import counted
from falsifier.errors import SpecError

# What is told of one file, and of all together: some 3500 and 6000 tokens, half of a prompt's limit.
MAX_CHARACTERS = 12_000
MAX_TOTAL = 20_000
_MAX_BYTES = 32 << 20
_MAX_COMPARISONS, _MAX_COMPARED = 60, 6_000  # number, and characters of all
_MAX_CROSSINGS = 24  # of a signal
_ESCAPE = re.compile(r"\\(?:u([0-9a-fA-F]{4})|([/\\\"]))")
_LEAVE_OUT = "remove it, or leave the file out"


@dataclass(frozen=True, slots=True)
class _File:
    """One file as it was read."""

    path: str  # as it was named
    name: str  # as it is told: without folders, which often have names of people and customers
    sha256: str
    content: str | Diagram | Source
    is_named: bool  # whether the user named it; it lies inside an FMU otherwise


# Files with what they contain.
_Contents = Sequence[tuple[_File, Readable]]


def gather(
    files: Iterable[str],
    fmus: Iterable[Path],
    *,
    seeds: Collection[str],
    signals: Collection[str],
    checked: Collection[str] = (),
    ranges: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    is_told: bool = True,
) -> Context:
    """Return what files and the inside of FMUs say of a model; nothing else is opened.

    Diagrams are cut to what the ``seeds`` depend on, the requirement's signals; ``signals`` are all that the
    language model is told. ``checked`` are files with a line that looks like a secret and is none, by the
    names that messages give them, and ``ranges`` the bounds of inputs and parameters whose crossings are
    wanted. If nothing is sent, ``is_told`` is false: nothing is refused as a secret, and only crossings are
    returned.

    Raises:
        SpecError: naming the file that is missing, damaged or binary, the line that looks like a secret, or a
            checked file that is not told.
        ModelError: if an archive is damaged or dangerous.
    """
    sentry = Sentry(checked) if is_told else None
    once: dict[str, str] = {}
    for name in files:  # a spec and an option may name one file in different ways
        once.setdefault(realpath(name), name)
    found = [_read(Path(name), name, sentry) for name in once.values()]
    notes = []
    for fmu in fmus:
        for entry, content in inside(fmu):
            name, text = f"{fmu.name}: {entry}", text_of(content)
            if text is None:
                notes.append(f"context {name} is left out, because it is not text")
                continue
            if sentry is not None:
                sentry.look(text, name, name, NAME_THEM)
            read = read_source(text, name) or text
            found.append(_File(name, name, sha256(content).hexdigest(), read, is_named=False))
    library = [file.content for file in found if isinstance(file.content, Source)]

    def readable_of(file: _File) -> Readable:
        if isinstance(file.content, Diagram):
            return of_diagram(file.content, seeds)
        if isinstance(file.content, Source):
            return of_source(file.content, library, seeds, is_named=file.is_named)
        return of_text(file.content, file.name, signals)

    contents = [(file, readable_of(file)) for file in found]
    # Of the files inside an FMU, those with one form say nothing about the signals.
    contents = [(file, readable) for file, readable in contents if file.is_named or len(readable.forms) > 1]
    found_in = [threshold for _, readable in contents for threshold in readable.found]
    crossings = tuple(each for name, ends in ranges.items() for each in _crossings(found_in, name, *ends))
    if sentry is None:
        return Context(crossings=crossings)
    compared = _compared(contents, signals)
    chosen = _fitting(contents, MAX_TOTAL - sum(len(each.text) for each in compared))
    excerpts = []
    for (file, readable), (i, text) in zip(contents, chosen, strict=True):
        # Encodings may have hidden a secret before, and escapes of JSON still do.
        joined = "\n".join((text, *(t.text for t in readable.found)))
        whole = _ESCAPE.sub(lambda found: chr(int(found[1], 16)) if found[1] else found[2], joined)
        otherwise = _LEAVE_OUT if file.is_named else NAME_THEM
        sentry.look(whole, f"{file.path}, as it is told", file.path, otherwise)
        form = f"{readable.forms[i][0]}{', because the rest is too long' if i else ''}"
        excerpts.append(Excerpt(file.path, file.name, file.sha256, form, text))
    sentry.refuse_unused()
    return Context(tuple(excerpts), tuple(compared), crossings, (*notes, *sentry.notes))


def _read(path: Path, name: str, sentry: Sentry | None) -> _File:
    try:
        if not path.is_file() and path.exists():  # a pipe or device might never end
            raise SpecError(f"context {name}: expected a file; name the files of a folder one by one")
        if path.stat().st_size > _MAX_BYTES:
            raise SpecError(
                f"context {name}: has {path.stat().st_size >> 20} MiB, more than {_MAX_BYTES >> 20}; name a "
                "file with only the part that matters"
            )
        content = path.read_bytes()
    except OSError as error:
        raise SpecError(f"context {name}: cannot be read ({error.strerror or error})") from None
    is_diagram, is_package = path.suffix.lower() in SIMULINK, path.suffix.lower() == ".slx"
    text = content.decode("utf-8", "replace") if is_diagram else text_of(content)
    if text is None:
        raise SpecError(
            f"context {name}: expected text or a Simulink file, found binary data, or a PDF or RTF document; "
            "save it as text in UTF-8, or leave it out"
        )
    if sentry is not None and is_package:
        for part, packed in read_parts(path).items():
            sentry.look(packed.decode("utf-8", "replace"), f"{name}: {part}", name, _LEAVE_OUT)
    elif sentry is not None:
        sentry.look(text, name, name, _LEAVE_OUT)
    read = read_diagram(path) if is_diagram else read_source(text, path.name) or text
    return _File(name, path.name, sha256(content).hexdigest(), read, is_named=True)


def _fitting(contents: _Contents, room: int) -> list[tuple[int, str]]:
    """Return number and text of each file's fullest form so that each and all together fit.

    The last form of each file is some words long, so that each by itself fits in any case.
    """
    forms = [readable.forms for _, readable in contents]
    chosen = [
        next(i for i, (_, text) in enumerate(each) if 0 < len(text) <= MAX_CHARACTERS or i == len(each) - 1)
        for each in forms
    ]
    around = sum(len(file.name) + max(len(name) for name, _ in readable.forms) for file, readable in contents)

    def size(k: int) -> int:
        return len(forms[k][chosen[k]][1])

    while sum(map(size, range(len(forms)))) + around > room:
        shrinkable = [k for k, i in enumerate(chosen) if i + 1 < len(forms[k])]
        if not shrinkable:
            raise SpecError(
                f"context: {counted(len(contents), 'file')} are too many even to give only their "
                "names; name fewer"
            )
        chosen[max(shrinkable, key=size)] += 1
    return [(i, each[i][1]) for i, each in zip(chosen, forms, strict=True)]


def _crossings(found: Iterable[Threshold], name: str, low: float, high: float) -> list[Crossing]:
    """Return the levels of a signal within its range; names in files may be those within a component."""
    names = {name, name.rpartition(".")[2].strip("'")}
    levels = {
        level
        for threshold in found
        if threshold.names and {each.strip("'") for each in threshold.names} <= names
        for level in threshold.levels
        if low <= level <= high
    }
    return [Crossing(name, level) for level in sorted(levels)[:_MAX_CROSSINGS]]


def _compared(contents: _Contents, signals: Collection[str]) -> list[Compared]:
    """Return what is said of signals of the model, then other thresholds, and how many do not fit."""
    ends: dict[str, list[str]] = {}  # components of a system may have signals of the same name
    for name in signals:
        words = name.split(".")
        for i in range(len(words)):
            ends.setdefault(".".join(words[i:]).strip("'"), []).append(name)
    limits = []
    for threshold in (t for _, readable in contents for t in readable.found):
        met = ends.keys() & {name.strip("'") for name in threshold.names}
        names = tuple(sorted(name for end in met for name in ends[end]))
        if names or threshold.place:  # a mode that sets no signal says nothing
            limits.append(Compared(names, threshold.text))
    limits.sort(key=lambda each: not each.signals)
    sizes = accumulate(len(each.text) for each in limits[:_MAX_COMPARISONS])
    fitting = sum(size <= _MAX_COMPARED for size in sizes)
    left_out = len(limits) - fitting
    return [*limits[:fitting], *([Compared((), f"... ({left_out} more)")] if left_out else [])]
