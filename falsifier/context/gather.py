"""Reads what a user named as context, refuses secrets, and tells as much of each file as fits."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from falsifier.context.fmu_files import inside
from falsifier.context.forms import Form, Readable, of_diagram, of_source
from falsifier.context.simulink import SUFFIXES as SIMULINK
from falsifier.context.simulink import read_diagram
from falsifier.context.simulink.parts import read_parts
from falsifier.context.thresholds import Threshold
from falsifier.context.values import Compared, Context, Excerpt
from falsifier.core.secrets import line_of_secret
from falsifier.core.words import counted
from falsifier.errors import SpecError

# What is told of one file, and of all together: some 3500 and 6000 tokens, half of a prompt's limit.
MAX_CHARACTERS = 12_000
MAX_TOTAL = 20_000
_MAX_BYTES = 32 << 20
_MAX_COMPARISONS = 60


@dataclass(frozen=True, slots=True)
class _Source:
    """One file with its forms."""

    path: str
    name: str
    sha256: str
    readable: Readable


def gather(
    files: Iterable[str], fmus: Iterable[Path], *, seeds: Collection[str], signals: Collection[str]
) -> Context:
    """Return what files and the inside of FMUs say of a model; nothing else is opened.

    Args:
        files: paths of files.
        fmus: FMUs to look into.
        seeds: the requirement's signals: sources are cut to what they depend on.
        signals: all signals that the language model is told.

    Raises:
        SpecError: naming the file that is missing, damaged or binary, or the line that looks like a secret.
        ModelError: if an archive is damaged or dangerous.
    """
    sources = [_read(Path(name), name, seeds, signals) for name in dict.fromkeys(files)]
    for fmu in fmus:
        for name, content in inside(fmu):
            found = _text_source(content, f"{fmu.name}: {name}", seeds, signals, is_named=False)
            if len(found.readable.forms) > 1:  # otherwise it says nothing about the signals
                sources.append(found)
    chosen, compared = _fitting(sources), tuple(_compared(sources, signals))
    for source, (_, text) in zip(sources, chosen, strict=True):
        _refuse_secrets(text, f"{source.path}, as it is told")  # what encodings may have hidden before
    for each in compared:
        _refuse_secrets(each.text, each.place)
    return Context(
        tuple(
            Excerpt(s.path, s.name, s.sha256, _shortened(s.readable.forms, i), text)
            for s, (i, text) in zip(sources, chosen, strict=True)
        ),
        compared,
    )


def _read(path: Path, name: str, seeds: Collection[str], signals: Collection[str]) -> _Source:
    try:
        if not path.is_file() and path.exists():  # a pipe or device might never end
            raise SpecError(f"context {name}: expected a file; name the files of a folder one by one")
        if path.stat().st_size > _MAX_BYTES:
            raise SpecError(
                f"context {name}: has {path.stat().st_size >> 20} MiB, more than {_MAX_BYTES >> 20}"
            )
        content = path.read_bytes()
    except OSError as error:
        raise SpecError(f"context {name}: cannot be read ({error.strerror or error})") from None
    if path.suffix.lower() not in SIMULINK:
        return _text_source(content, name, seeds, signals)
    if path.suffix.lower() == ".slx":
        for part, text in read_parts(path).items():
            _refuse_secrets(text.decode("utf-8", "replace"), f"{name}: {part}")
    else:
        _refuse_secrets(content.decode("utf-8", "replace"), name)
    return _Source(name, path.name, sha256(content).hexdigest(), of_diagram(read_diagram(path), seeds))


def _text_source(
    content: bytes, name: str, seeds: Collection[str], signals: Collection[str], *, is_named: bool = True
) -> _Source:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if "\0" in text:
        raise SpecError(f"context {name}: expected text or a Simulink file, found binary data; leave it out")
    _refuse_secrets(text, name)
    told = Path(name).name if is_named else name  # folders often have names of people and customers
    readable = of_source(text, told, seeds, signals, is_named=is_named)
    return _Source(name, told, sha256(content).hexdigest(), readable)


def _refuse_secrets(text: str, name: str) -> None:
    line = line_of_secret(text)
    if line is not None:
        raise SpecError(
            f"context {name}: line {line} looks like a key, token or password, so nothing is sent; remove "
            "it, or leave the file out"
        )


def _fitting(sources: list[_Source]) -> list[tuple[int, str]]:
    """Return number and text of each file's fullest form so that each and all together fit."""
    chosen = []
    for source in sources:
        forms = source.readable.forms
        texts = ((i, form.text()) for i, form in enumerate(forms))
        chosen.append(next((i, t) for i, t in texts if len(t) <= MAX_CHARACTERS or i == len(forms) - 1))
    while sum(len(text) for _, text in chosen) > MAX_TOTAL:
        shrinkable = [k for k, (i, _) in enumerate(chosen) if i + 1 < len(sources[k].readable.forms)]
        if not shrinkable:
            raise SpecError(
                f"context: {counted(len(sources), 'file')} are too many even with only their names told; "
                "name fewer"
            )
        longest = max(shrinkable, key=lambda k: len(chosen[k][1]))
        i = chosen[longest][0] + 1
        chosen[longest] = (i, sources[longest].readable.forms[i].text())
    return chosen


def _shortened(forms: tuple[Form, ...], i: int) -> str:
    return forms[i].name if i == 0 else f"{forms[i].name}, because the rest is too long"


def _compared(sources: list[_Source], signals: Collection[str]) -> Iterator[Compared]:
    """Return all thresholds, those of signals of the model first."""
    ends: dict[str, list[str]] = {}  # components of a system may have signals of the same name
    for name in signals:
        ends.setdefault(name.rpartition(".")[2].strip("'"), []).append(name)
    modes = [m for s in sources for m in s.readable.modes if m[0] in ends]
    yield from (Compared(tuple(ends[name]), text, "") for name, text in modes)
    found = [t for s in sources for t in s.readable.found]
    told = [(tuple(sorted(name for end in _plain(t) & ends.keys() for name in ends[end])), t) for t in found]
    ordered = sorted(told, key=lambda pair: not pair[0])
    yield from (Compared(names, t.text, t.place) for names, t in ordered[:_MAX_COMPARISONS])


def _plain(threshold: Threshold) -> frozenset[str]:
    return frozenset(name.strip("'") for name in threshold.names)
