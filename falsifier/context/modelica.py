"""Classes of Modelica files: the one that matters, and what the blocks of the standard library in it do."""

import re
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from falsifier.context.sources import Component, Source
from falsifier.context.thresholds import Threshold, at_breakpoints, number_in

# Comparisons by the type's name; names in braces are inputs, other names parameters.
_COMPARING: Mapping[str, tuple[str, ...]] = {
    "DeadZone": ("{u} > uMax", "{u} < uMin"),
    "Greater": ("{u1} > {u2}",),
    "GreaterEqual": ("{u1} >= {u2}",),
    "GreaterEqualThreshold": ("{u} >= threshold",),
    "GreaterThreshold": ("{u} > threshold",),
    "Hysteresis": ("{u} > uHigh", "{u} < uLow"),
    "Less": ("{u1} < {u2}",),
    "LessEqual": ("{u1} <= {u2}",),
    "LessEqualThreshold": ("{u} <= threshold",),
    "LessThreshold": ("{u} < threshold",),
    "Limiter": ("{u} > uMax", "{u} < uMin"),
    "OnOffController": ("{u} > {reference} + bandwidth / 2", "{u} < {reference} - bandwidth / 2"),
    "ZeroCrossing": ("{u} > 0",),
}
# What the library gives to parameters.
_DEFAULTS = {"uLow": "0", "uHigh": "1", "threshold": "0", "bandwidth": "0.1", "k": "1", "k1": "1", "k2": "1"}
_MAX_BASES = 50
_TABLES = ("CombiTable1D", "CombiTable1Ds", "CombiTable1Dv")
_MADE: Mapping[str, str] = {
    "Abs": "abs({u})",
    "Add": "k1 * ({u1}) + k2 * ({u2})",
    "Constant": "k",
    "Feedback": "{u1} - ({u2})",
    "Gain": "k * ({u})",
    "Max": "max({u1}, {u2})",
    "Min": "min({u1}, {u2})",
} | dict.fromkeys(
    ("CriticalDamping", "Filter", "FirstOrder", "FixedDelay", "Limiter", "SecondOrder", "SlewRateLimiter",
     "UnitDelay", "ZeroOrderHold"),
    "{u}",  # their output is their input, later or limited
)  # fmt: skip
_ROW = re.compile(r"(?:^\s*\[|;)\s*([-+]?[\d.]++(?:[eE][-+]?\d++)?)")
_WORD = re.compile(r"\{(\w+)\}|\b[a-zA-Z]\w*\b")


def class_for(source: Source, library: Sequence[Source], names: Iterable[str]) -> list[str]:
    """Return the class of a file that declares most of these names, the last one on ties, and its bases.

    Args:
        source: the file.
        library: all files that were read.
        names: the names.
    """
    wanted = frozenset(names)
    files = (*library, source)
    bases = {name: extended for s in files for name, extended in s.bases.items()}
    has = {name: wanted.intersection(found) for s in files for name, found in s.components.items()}
    best, most = list[str](), 0
    for name in dict.fromkeys(statement.scope for statement in source.statements):
        merged, queue = [name], deque(bases.get(name, ()))
        while queue and len(merged) < _MAX_BASES:
            base = _last(queue.popleft())
            if (base in has or base in bases) and base not in merged:
                merged.append(base)
                queue += bases.get(base, ())
        count = len(frozenset[str]().union(*(has.get(each, frozenset()) for each in merged)))
        if count >= max(most, 1):
            best, most = merged, count
    return best


def used_classes(names: Iterable[str], main: Collection[str], library: Iterable[Source]) -> list[str]:
    """Return other classes that some names stand for, and those that these use in turn."""
    uses: dict[str, set[str]] = {}
    for source in library:
        for statement in source.statements:
            uses.setdefault(statement.scope, set()).update(statement.uses)
        for scope, declared in source.components.items():
            uses.setdefault(scope, set()).update(_last(element.kind) for element in declared.values())
    queue = deque(names)
    used: dict[str, None] = {}
    while queue:
        name = queue.popleft()
        if name in uses and name not in main and name not in used:
            used[name] = None
            queue += sorted(uses[name])
    return list(used)


def _last(name: str) -> str:
    return name.rpartition(".")[2]


def comparisons(
    declared: Mapping[str, Component], leading: Mapping[str, str], kept: Collection[str] | None
) -> Iterator[tuple[str, int]]:
    """Return what components compare, with their lines.

    Args:
        declared: the elements of a class.
        leading: what leads to the inputs of components.
        kept: names of those to look at; None: all.
    """
    for name, element in declared.items():
        for text in _COMPARING.get(_last(element.kind), ()) if kept is None or name in kept else ():
            yield _filled(text, name, element, leading), element.line


def tables(
    declared: Mapping[str, Component],
    leading: Mapping[str, str],
    kept: Collection[str] | None,
    constants: Mapping[str, str],
    shown: str,
) -> Iterator[Threshold]:
    """Return the breakpoints of tables, as far as they stand in the source."""
    for name, element in declared.items():
        source = next((leading[p] for p in (f"{name}.u", f"{name}.u[1]") if p in leading), "")
        if _last(element.kind) in _TABLES and source and (kept is None or name in kept):
            text = element.modifiers.get("table", "")
            found = [row for row in _ROW.findall(constants.get(text, text)) if number_in(row) is not None]
            if found:
                yield at_breakpoints(source, found, f"{shown}:{element.line}")


def outputs(declared: Mapping[str, Component], leading: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Return expressions of the outputs of components, by their names: ``gain.y``."""
    for name, element in declared.items():
        if _last(element.kind) in _MADE:
            yield f"{name}.y", _filled(_MADE[_last(element.kind)], name, element, leading)


def _filled(text: str, name: str, element: Component, leading: Mapping[str, str]) -> str:
    """Return an expression with the component's parameters, and what leads to its inputs."""
    stated = {"uMin": f"-({element.modifiers.get('uMax', 'uMax')})", **_DEFAULTS, **element.modifiers}

    def value(word: re.Match[str]) -> str:
        port = word[1]
        if port is None:
            return stated.get(word[0], word[0])
        return leading.get(f"{name}.{port}") or element.modifiers.get(port) or f"{name}.{port}"

    return _WORD.sub(value, text)
