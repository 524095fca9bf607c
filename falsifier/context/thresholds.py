"""Which constants are compared with which signals, in conditions of any of the languages that are read."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isinf

from falsifier.context.tokens import Token, tokens_of, written

_RELATIONS = ("<", "<=", ">", ">=", "==", "!=", "<>")
_SIGNS = ("<", ">", "==", "!=")
# What ends an operand at its own depth of brackets.
_BOUNDING = "and or not && || ! if then else elseif when elsewhen while for loop , ; ? : = := { } return"
_BOUNDARIES = frozenset(_BOUNDING.split())
_OPENING, _CLOSING = "([{", ")]}"
_DECIMAL = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_HEXADECIMAL = r"0[xX][0-9a-fA-F]+(?:\.?[0-9a-fA-F]*[pP][-+]?\d+)?"
_NUMBER = re.compile(rf"([-+]?)(?:({_HEXADECIMAL})|({_DECIMAL}))[fFlLuU]*$")
_MAX_LENGTH = 160
_MAX_CONDITION = 10_000


@dataclass(frozen=True, slots=True)
class Threshold:
    """One comparison with a constant.

    Attributes:
        names: variables in it that are not constants.
        text: the comparison as written, with the values of named constants: ``u > limit (limit = 9.5)``.
        left: what stands before the sign, as written.
        right: what stands behind it.
        constants: values of the named constants in it, as written; ``5 or 9`` if there are two. Also what
            variables of a function or chart stand for, and empty texts for those that nothing outside knows.
        place: file and line, or block.
    """

    names: frozenset[str]
    text: str
    left: str
    right: str
    constants: Mapping[str, str]
    place: str


def thresholds(
    texts: Iterable[tuple[str, int]], constants: Mapping[str, str], file: str
) -> Iterator[Threshold]:
    """Return the comparisons of variables with numbers or named constants.

    Args:
        texts: conditions and statements, with their lines.
        constants: values of named constants, as written.
        file: name of the file, for places.
    """
    seen = set()
    for text, line in texts:
        if len(text) > _MAX_CONDITION or not any(sign in text for sign in _SIGNS):
            continue
        tokens = tokens_of(text, file)
        for i, token in enumerate(tokens):
            if token.text in _RELATIONS:
                left, right = _before(tokens, i), _behind(tokens, i)
                found = _threshold(text, left, token, right, constants, f"{file}:{line}" if line else file)
                if found is not None and found.text not in seen:
                    seen.add(found.text)
                    yield found


def within(found: Threshold, names: Mapping[str, str]) -> Threshold:
    """Return a comparison as it is seen from outside its function, class or chart.

    Args:
        found: the comparison.
        names: what variables in it stand for outside; empty text for those that are only known inside.
    """
    inner = {name: names[name] for name in found.names if name in names}
    outer = {name for name in inner.values() if name.isidentifier()}
    stands = {name: text for name, text in inner.items() if text}
    said = ", ".join(f"{name} = {text}" for name, text in stands.items())
    return replace(
        found,
        names=(found.names - inner.keys()) | outer,
        text=f"{found.text} ({said})" if said else found.text,
        constants={**found.constants, **inner},
    )


def number_in(text: str) -> float | None:
    """Return the number that a text is; None if it is not just a number, or too large for one."""
    found = _NUMBER.match(text.strip().strip("()"))
    if found is None:
        return None
    sign, hexadecimal, decimal = found.groups()
    try:
        number = float(decimal) if decimal else float.fromhex(hexadecimal)
    except OverflowError:
        return None
    if isinf(number):
        return None
    return -number if sign == "-" else number


def _threshold(
    text: str,
    left: list[Token],
    relation: Token,
    right: list[Token],
    constants: Mapping[str, str],
    place: str,
) -> Threshold | None:
    if not left or not right:
        return None
    tokens = [*left, relation, *right]
    names = {t.text for t in _variables(tokens)}
    known = {name: constants[name] for name in sorted(names) if name in constants}
    named = {name: value for name, value in known.items() if len(value) <= _MAX_LENGTH}
    values = [value for t in tokens if t.kind == "number" and (value := number_in(t.text)) is not None]
    values += [
        value for s in named.values() for each in s.split(" or ") if (value := number_in(each)) is not None
    ]
    variables = names - known.keys()
    if not variables or not values:
        return None
    shown = written(text, tokens)
    if len(shown) > _MAX_LENGTH:
        return None
    stated = f" ({', '.join(f'{n} = {v}' for n, v in named.items())})" if named else ""
    sides = written(text, left), written(text, right)
    return Threshold(frozenset(variables), f"{shown}{stated}", *sides, named, place)


def _variables(tokens: list[Token]) -> Iterator[Token]:
    """Names that are no functions and, of ``a.b`` and ``a->b``, the last ones."""
    for token, after in zip(tokens, [*tokens[1:], None], strict=True):
        if token.kind == "name" and (after is None or after.text not in ("(", ".", "->")):
            yield token


def _behind(tokens: list[Token], i: int) -> list[Token]:
    return list(_operand(tokens[i + 1 :], _OPENING, _CLOSING))


def _before(tokens: list[Token], i: int) -> list[Token]:
    return list(_operand(tokens[:i][::-1], _CLOSING, _OPENING))[::-1]


def _operand(tokens: list[Token], opening: str, closing: str) -> Iterator[Token]:
    depth = 0
    for token in tokens:
        if token.text in closing and len(token.text) == 1:
            depth -= 1
            if depth < 0:
                return
        if depth == 0 and (token.text in _BOUNDARIES or token.text in _RELATIONS):
            return
        if token.text in opening and len(token.text) == 1:
            depth += 1
        yield token
