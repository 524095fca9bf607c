"""What Modelica compares: in the class that declares the signals, and in blocks of the standard library."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from falsifier.context.crossings import Definitions
from falsifier.context.sources import Component, Scope, Source, definitions_of
from falsifier.context.thresholds import Threshold, at_breakpoints, number_in, thresholds, within

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


def modelica_comparisons(
    source: Source, library: Sequence[Source], signals: Collection[str]
) -> tuple[list[Threshold], Mapping[str, str], Definitions]:
    """Return what a file compares, values of its parameters, and what its variables are equal to.

    Args:
        source: the file.
        library: all files that were read: a class may extend one of another file.
        signals: signals of the model. Variables of classes that do not declare most of them are not the
            signals of the same name.
    """
    scopes = {name: scope for each in (*library, source) for name, scope in each.scopes.items()}
    main = _class_with_bases(source, scopes, roots_of(signals))
    constants = _constants(main, scopes, library)
    declared = {name: element for each in main for name, element in scopes[each].components.items()}
    leading = {port: text for each in main for port, text in scopes[each].leading.items()}
    found: list[Threshold] = []
    for name, scope in source.scopes.items():
        is_main = name in main
        ports = leading if is_main else scope.leading
        values = constants if is_main else _constants([name], scopes, library)
        texts = [*scope.texts, *_comparisons(scope.components, ports)]
        limits = [*thresholds(texts, values, source.shown, is_dotted=True)]
        limits += _tables(scope.components, ports, values, source.shown)
        found += limits if is_main else [within(limit, dict.fromkeys(limit.names, "")) for limit in limits]
    known = definitions_of(scopes[name] for name in main)
    made = dict(_outputs(declared, leading))
    return found, constants, Definitions({**made, **leading, **known.equal}, known.fed)


def roots_of(names: Collection[str]) -> set[str]:
    """Names under which a source may declare signals: those of components or members, and the last ones."""
    return {part for name in names for part in (name.partition(".")[0], name.rpartition(".")[2])}


def _class_with_bases(source: Source, scopes: Mapping[str, Scope], names: Collection[str]) -> list[str]:
    """Return the class of a file that declares most of these names, the last one on ties, and its bases."""
    best, most = list[str](), 1
    for name in source.scopes:
        merged = [name]
        for each in merged:  # grows
            merged += [base for base in scopes[each].bases if base in scopes and base not in merged]
            del merged[_MAX_BASES:]
        count = len({n for each in merged for n in scopes[each].components if n in names})
        if count >= most:
            best, most = merged, count
    return best


def _constants(
    names: Iterable[str], scopes: Mapping[str, Scope], library: Iterable[Source]
) -> dict[str, str]:
    """Return values of parameters with those that modifiers give them: which holds is not told apart."""
    found = {n: dict.fromkeys(v) for name in names for n, v in scopes[name].constants.items()}
    for source in library:
        for name in found.keys() & source.modified.keys():
            found[name] |= dict.fromkeys(source.modified[name])
    return {name: " or ".join(values) for name, values in found.items()}


def _last(name: str) -> str:
    return name.rpartition(".")[2]


def _comparisons(declared: Mapping[str, Component], leading: Mapping[str, str]) -> Iterator[tuple[str, int]]:
    """Return what the components of a class compare, by what leads to them, with their lines."""
    for name, element in declared.items():
        for text in _COMPARING.get(_last(element.kind), ()):
            yield _filled(text, name, element, leading), element.line


def _tables(
    declared: Mapping[str, Component],
    leading: Mapping[str, str],
    constants: Mapping[str, str],
    shown: str,
) -> Iterator[Threshold]:
    """Return the breakpoints of tables, as far as they stand in the source."""
    for name, element in declared.items():
        source = next((leading[p] for p in (f"{name}.u", f"{name}.u[1]") if p in leading), "")
        if _last(element.kind) in _TABLES and source:
            text = element.modifiers.get("table", "")
            found = [row for row in _ROW.findall(constants.get(text, text)) if number_in(row) is not None]
            if found:
                yield at_breakpoints(source, found, f"{shown}:{element.line}")


def _outputs(declared: Mapping[str, Component], leading: Mapping[str, str]) -> Iterator[tuple[str, str]]:
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
