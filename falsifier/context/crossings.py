"""Values of inputs and parameters at which a comparison in a file changes: solved for them where possible."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from falsifier.context.thresholds import Threshold, number_in, tokens_of
from falsifier.context.values import Crossing
from falsifier.errors import FormulaError
from falsifier.stl import parse
from falsifier.stl.expression import Expression
from falsifier.stl.formula import Predicate

Array = NDArray[np.float64]

# Values of an input at which both sides of a comparison are compared, and halvings of what lies between two.
_SAMPLES, _HALVINGS = 257, 40
# A constant that is given twice, "5 or 9", has two values; of several constants, so many combinations count.
_MAX_COMBINATIONS = 24
_MAX_DEPTH = 12
_MAX_CROSSINGS = 24
_MAX_THRESHOLDS = 2000
_MAX_LENGTH = 400
# Functions by the name that formulas have. The last value of a signal, or its value in another type, is the
# signal itself here.
_FUNCTIONS = {name: name for name in ("abs", "sqrt", "min", "max")} | {"fabs": "abs", "fabsf": "abs"}
_FUNCTIONS |= dict.fromkeys(("pre", "noEvent", "real", "double", "single", "float", "Real"), "")


class _UnknownError(ValueError):
    """The value of a text is not known."""


def crossings_of(
    found: Iterable[Threshold], ranges: Mapping[str, tuple[float, float]]
) -> tuple[Crossing, ...]:
    """Return the values within their ranges at which signals make a comparison change.

    Args:
        found: the comparisons.
        ranges: bounds of inputs and parameters, by their names in the model.
    """
    crossings: dict[str, set[float]] = {name: set() for name in ranges}
    for threshold in islice((each for each in found if each.names), _MAX_THRESHOLDS):
        for name, (low, high) in ranges.items():
            if low < high and len(crossings[name]) < _MAX_CROSSINGS:
                crossings[name].update(_solutions(threshold, name, low, high))
    return tuple(
        Crossing(name, value) for name, each in crossings.items() for value in sorted(each)[:_MAX_CROSSINGS]
    )


def _solutions(threshold: Threshold, name: str, low: float, high: float) -> Iterator[float]:
    signal = name.rpartition(".")[2].strip("'")
    constants = sorted(threshold.constants)
    choices = [[v.strip() for v in threshold.constants[c].split(" or ")] for c in constants]
    for values in islice(product(*choices), _MAX_COMBINATIONS):
        stated = dict(zip(constants, values, strict=True))

        def margin(at: Array, stated: Mapping[str, str] = stated) -> Array:
            left, right = (_value(side, signal, at, stated) for side in (threshold.left, threshold.right))
            return np.broadcast_to(left - right, at.shape)

        try:
            with np.errstate(all="ignore"):
                yield from _roots(margin, np.linspace(low, high, _SAMPLES))
        except _UnknownError:
            return


def _roots(margin: Callable[[Array], Array], at: Array) -> Iterator[float]:
    """Return where a margin changes its sign, or touches zero."""
    values = margin(at)
    if not np.isfinite(values).all() or not values.any():
        return
    yield from (float(x) for x in at[values == 0])
    signs = np.sign(values)
    for i in np.flatnonzero(signs[:-1] * signs[1:] < 0):
        below, above = at[i : i + 1], at[i + 1 : i + 2]
        for _ in range(_HALVINGS):
            middle = (below + above) / 2
            is_left = np.sign(margin(middle)) == signs[i]
            below, above = np.where(is_left, middle, below), np.where(is_left, above, middle)
        yield float(f"{float(above[0]):.9g}")


def _value(text: str, signal: str, at: Array, constants: Mapping[str, str], depth: int = 0) -> Array:
    """Return the value of an expression for values of a signal.

    Raises:
        _UnknownError: if it has something else than arithmetic, constants and this signal.
    """
    expression, names = _parsed(text)
    if expression is None or depth > _MAX_DEPTH:
        raise _UnknownError(text)
    columns = {}
    for variable in expression.signals:
        name = names[int(variable[1:])]
        if name not in constants:
            name = name.rpartition(".")[2]  # of a.b, what is known of b
        if name in constants:
            columns[variable] = _value(constants[name], signal, at, constants, depth + 1)
        elif name == signal:
            columns[variable] = at
        else:
            raise _UnknownError(name)
    return expression.evaluate(columns)


@lru_cache(maxsize=10_000)
def _parsed(text: str) -> tuple[Expression | None, tuple[str, ...]]:
    """Return an expression of v0, v1, ..., and what these names stand for; None if it is not understood."""
    names: list[str] = []
    try:
        formula = parse(f"({_as_term(text, names)}) <= 0") if len(text) <= _MAX_LENGTH else None
    except FormulaError:
        formula = None
    return (formula.left if isinstance(formula, Predicate) else None), tuple(names)


def _as_term(text: str, names: list[str]) -> str:
    """Return an expression as formulas have it, with other names; of ``a->b`` only the last one counts."""
    words: list[str] = []
    tokens = list(tokens_of(text))
    for i, token in enumerate(tokens):
        before, after = tokens[i - 1].text if i else "", tokens[i + 1].text if i + 1 < len(tokens) else ""
        number = number_in(token.text) if token.kind == "number" else None
        if token.text == "->" and words:
            words.pop()
        elif token.kind == "name" and after == "(":
            words.append(_FUNCTIONS.get(token.text, "?"))
        elif token.kind == "name" and before == "." and names:
            names[-1] += f".{token.text}"
        elif token.kind == "name":
            words.append(f"v{len(names)}")
            names.append(token.text.strip("'"))
        elif number is not None:
            words.append(f"{number:.17g}")
        elif token.text != ".":
            words.append(token.text)
    return " ".join(words)
