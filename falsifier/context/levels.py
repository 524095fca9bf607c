"""Levels of inputs and parameters at which a comparison in a file changes: solved for them where possible."""

import ast
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from falsifier.context.thresholds import Threshold, number_in, tokens_of
from falsifier.context.values import Level

Array = NDArray[np.float64]

# Values of an input at which both sides of a comparison are compared, and halvings of what lies between two.
_SAMPLES, _HALVINGS = 257, 40
# A constant that is given twice, "5 or 9", has two values; of several constants, so many combinations count.
_MAX_COMBINATIONS = 24
_MAX_DEPTH = 12
_MAX_LEVELS = 24
_MAX_THRESHOLDS = 2000
_MAX_LENGTH = 400
_BINARY: Mapping[type[ast.operator], Callable[[Array, Array], Array]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
# The last value of a signal, or its value in another type, is the signal itself here.
_UNCHANGED = frozenset(("pre", "noEvent", "smooth", "real", "double", "single", "float", "Real"))
_FUNCTIONS: Mapping[str, Callable[..., Array]] = {
    "abs": np.abs,
    "fabs": np.abs,
    "fabsf": np.abs,
    "sqrt": np.sqrt,
    "min": np.minimum,
    "max": np.maximum,
}


class _UnknownError(ValueError):
    """The value of a text is not known."""


@dataclass(frozen=True, slots=True)
class Definitions:
    """What a file says of the values of variables.

    Attributes:
        equal: expressions by the variables that they are the only value of.
        fed: variables on which others depend in one step; these follow them, if nothing better is known.
    """

    equal: Mapping[str, str] = field(default_factory=dict)
    fed: Mapping[str, frozenset[str]] = field(default_factory=dict)


def levels_of(
    found: Iterable[Threshold], known: Definitions, ranges: Mapping[str, tuple[float, float]]
) -> tuple[Level, ...]:
    """Return the values within their ranges at which signals make a comparison change.

    Args:
        found: the comparisons.
        known: values of other variables in them.
        ranges: bounds of inputs and parameters, by their names in the model.
    """
    levels: dict[str, set[float]] = {name: set() for name in ranges}
    for threshold in islice((each for each in found if _is_known(each, known)), _MAX_THRESHOLDS):
        for name, (low, high) in ranges.items():
            if low < high and len(levels[name]) < _MAX_LEVELS:
                short = name.rpartition(".")[2].strip("'")
                levels[name].update(_crossings(threshold, short, known, low, high))
    return tuple(Level(name, value) for name, each in levels.items() for value in sorted(each)[:_MAX_LEVELS])


def _is_known(threshold: Threshold, known: Definitions) -> bool:
    """Whether it has a variable of the model, or one of a function that is made of such."""
    inner = (name for name, text in threshold.constants.items() if not text)
    return bool(threshold.names) or any(name in known.equal for name in inner)


def _crossings(
    threshold: Threshold, name: str, known: Definitions, low: float, high: float
) -> Iterator[float]:
    constants = sorted(threshold.constants)
    choices = [[v.strip() for v in threshold.constants[c].split(" or ")] for c in constants]
    for values in islice(product(*choices), _MAX_COMBINATIONS):
        stated = dict(zip(constants, values, strict=True))

        def margin(at: Array, stated: Mapping[str, str] = stated) -> Array:
            scope = _Scope(name, known, stated, at)
            left, right = (scope.value(side) for side in (threshold.left, threshold.right))
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


@dataclass(frozen=True, slots=True)
class _Scope:
    """Evaluates expressions of Modelica, C and Simulink in which one signal varies.

    States that feed each other are followed for some steps. Values of names are kept per step: without that,
    time would grow with a power of the number of states.

    Attributes:
        signal: the signal.
        known: values of other variables.
        constants: values of the constants.
        at: values of the signal.
    """

    signal: str
    known: Definitions
    constants: Mapping[str, str]
    at: Array
    _kept: dict[tuple[str, int], Array | None] = field(default_factory=dict)

    def value(self, text: str, depth: int = 0) -> Array:
        """Return the value of an expression for each value of the signal.

        Raises:
            _UnknownError: if it has something else than arithmetic, or a variable of unknown value.
        """
        if depth > _MAX_DEPTH or len(text) > _MAX_LENGTH:
            raise _UnknownError(text)
        tree, names = _parsed(text)
        if tree is None:
            raise _UnknownError(text)
        try:
            return self._of(tree, names, depth)
        except (RecursionError, ArithmeticError):
            raise _UnknownError(text) from None

    def _of(self, node: ast.expr, names: Sequence[str], depth: int) -> Array:
        match node:
            case ast.Constant(value=int() | float() as number):
                return np.asarray(float(number))
            case ast.Name(id=placeholder):
                return self._kept_value(names[int(placeholder[1:])], depth)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self._of(operand, names, depth)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._of(operand, names, depth)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                sides = (self._of(side, names, depth) for side in (left, right))
                return _BINARY[type(op)](*sides)
            case ast.Call(func=ast.Name(id=placeholder), args=[_, *_] as args, keywords=[]):
                function = names[int(placeholder[1:])].rpartition(".")[2]
                values = [self._of(a, names, depth) for a in args]
                if function in _UNCHANGED:
                    return values[-1]
                if function in _FUNCTIONS and len(values) == 1 + (function in ("min", "max")):
                    return _FUNCTIONS[function](*values)
        raise _UnknownError(ast.dump(node))

    def _kept_value(self, name: str, depth: int) -> Array:
        if (name, depth) not in self._kept:
            try:
                self._kept[name, depth] = self._named(name, depth)
            except _UnknownError:
                self._kept[name, depth] = None
        value = self._kept[name, depth]
        if value is None:
            raise _UnknownError(name)
        return value

    def _named(self, name: str, depth: int) -> Array:
        if name not in self.constants and name not in self.known.equal:
            name = name.rpartition(".")[2]  # of a.b, what is known of b
        if name in self.constants and (self.constants[name] or name not in self.known.equal):
            return self.value(self.constants[name], depth + 1)
        if name == self.signal and name not in self.constants:
            return self.at
        if name in self.known.equal:
            try:
                return self.value(self.known.equal[name], depth + 1)
            except _UnknownError:
                pass  # it may follow the signal all the same
        if self.signal in self.known.fed.get(name, ()):
            return self.at
        raise _UnknownError(name)


@lru_cache(maxsize=10_000)
def _parsed(text: str) -> tuple[ast.expr | None, tuple[str, ...]]:
    """Return an expression, or None if it is not understood, with placeholders for its names."""
    names: list[str] = []
    try:
        return ast.parse(_as_python(text, names), mode="eval").body, tuple(names)
    except (SyntaxError, MemoryError, RecursionError, ValueError):
        return None, ()


def _as_python(text: str, names: list[str]) -> str:
    """Return an expression with placeholders for its names; of ``a->b`` only the last one counts."""
    words: list[str] = []
    is_member = False
    for token in tokens_of(text):
        if token.text == "->" and words:
            words.pop()
        elif token.text == "." and words and words[-1].startswith("_"):
            is_member = True
            continue
        elif token.kind == "name" and is_member:
            names[-1] += f".{token.text}"
        elif token.kind == "name":
            words.append(f"_{len(names)}")
            names.append(token.text.strip("'"))
        elif token.kind == "number":
            number = number_in(token.text)
            words.append(token.text if number is None else f"{number:.17g}")
        else:
            words.append(token.text)
        is_member = False
    return " ".join(words)
