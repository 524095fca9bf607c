"""What C compares: with macros, constants, and fields of structures that another file fills."""

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence

from falsifier.context.crossings import Definitions
from falsifier.context.sources import Scope, Source, definitions_of, sides_of, split_at_commas
from falsifier.context.thresholds import Threshold, thresholds, within

_MEMBER = re.compile(r"(?:->|\.)\s*(\w+)")
_MAX_DEPTH = 20  # of structures within structures


def c_comparisons(
    source: Source, library: Sequence[Source], signals: Collection[str]
) -> tuple[list[Threshold], Mapping[str, str], Definitions]:
    """Return what a file compares, values of constants, and what its variables are equal to.

    Args:
        source: the file.
        library: all files that were read: each may define structures and macros of another one.
        signals: signals of the model, which are no constants although a structure may give their first value.
    """
    constants = _constants(library, signals)
    found: dict[str, Threshold] = {}
    for scope in source.scopes.values():
        for limit in thresholds(scope.texts, constants, source.shown):
            found.setdefault(limit.text, _from_outside(limit, scope))
    return list(found.values()), constants, definitions_of(source.scopes.values())


def _from_outside(limit: Threshold, function: Scope) -> Threshold:
    """Return a comparison as it is seen from outside a function that declares some variables."""
    inner = limit.names.intersection(function.own).difference(_MEMBER.findall(limit.text))
    return within(limit, dict.fromkeys(inner, ""))


def _constants(sources: Sequence[Source], signals: Collection[str]) -> Mapping[str, str]:
    """Return values of macros, constants and fields of filled structures; ``5 or 9`` if there are two."""
    found: dict[str, dict[str, None]] = defaultdict(dict)
    structures = {name: fields for s in sources for name, fields in s.structures.items()}
    changing = {name.rpartition(".")[2] for name in signals}.union(*(s.names_set for s in sources))
    for source in sources:
        for name, texts in source.scopes[""].constants.items():
            found[name] |= dict.fromkeys(texts)
        for kind, values in source.filled:
            for name, value in _fields(kind, values, structures):
                if name not in changing:
                    found[name][value] = None
    return {name: " or ".join(texts) for name, texts in found.items()}


def _fields(
    kind: str, values: str, structures: Mapping[str, Sequence[tuple[str, str]]], depth: int = 0
) -> Iterator[tuple[str, str]]:
    """Return names and values of the fields of a structure, from ``{ 1, { 2, 3 }, .x = 4 }``."""
    fields = structures.get(kind, ())
    if len(fields) == 1 and not fields[0][1]:  # another name of this structure
        fields = structures.get(fields[0][0], ())
    at = 0
    for part in split_at_commas(values.strip()[1:-1]):
        left, _, right = sides_of(part)
        if right and left.startswith("."):
            at = next((i for i, (_, name) in enumerate(fields) if name == left[1:].strip()), at)
            part = right
        if at < len(fields) and part:
            inner, name = fields[at]
            if not part.startswith("{"):
                yield name, part
            elif depth < _MAX_DEPTH:
                yield from _fields(inner, part, structures, depth + 1)
        at += 1
