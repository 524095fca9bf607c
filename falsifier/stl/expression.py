"""Arithmetic over signals: the terms that predicates compare.

An expression is an immutable tree. ``str(expression)`` parses back to the same tree;
``expression.evaluate(columns)`` computes its value, for whole columns or for single numbers.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from falsifier.core.literals import shortest
from falsifier.stl.lexer import name_text

Operator = Literal["+", "-", "*", "/", "^"]
Function = Literal["abs", "sqrt", "exp", "log", "sin", "cos", "min", "max"]

FUNCTIONS_OF: dict[str, Callable[..., Any]] = {
    "abs": np.absolute, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos,
    "min": np.minimum, "max": np.maximum,
}  # fmt: skip
OPERATORS: dict[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.float_power,
}

# Precedence levels, also used by the parser; the levels of formulas (formula.py) are lower.
SUM, PRODUCT, SIGN, POWER, ATOM = 7, 8, 9, 10, 11


class Expression:
    """An arithmetic term over signals."""

    __slots__ = ()
    binding: ClassVar[int] = ATOM

    @property
    def operands(self) -> tuple["Expression", ...]:
        """Expressions directly below this one."""
        return ()

    def walk(self) -> Iterator["Expression"]:
        """Yield this expression and all below it, from left to right."""
        yield self
        for operand in self.operands:
            yield from operand.walk()

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals in order of first appearance."""
        return tuple(dict.fromkeys(e.name for e in self.walk() if isinstance(e, Name)))

    def evaluate(self, columns: Mapping[str, Any]) -> NDArray[np.float64]:
        """Return the value, in the shape of the given columns; that of a constant has no dimension.

        Outside the domain (square root of a negative number, division by zero) the value is NaN or infinite;
        there is no warning.
        """
        with np.errstate(all="ignore"):
            value: NDArray[np.float64] = np.asarray(self._value(columns), dtype=np.float64)
            return value

    def _value(self, columns: Mapping[str, Any]) -> Any:
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class Number(Expression):
    """A constant."""

    value: float

    @property
    def binding(self) -> int:  # type: ignore[override]
        """That of a unary minus for a negative number, which needs parentheses in the same places."""
        return SIGN if self.value < 0 else ATOM

    def __str__(self) -> str:
        return shortest(self.value)

    def _value(self, columns: Mapping[str, Any]) -> Any:
        return self.value


@dataclass(frozen=True, slots=True)
class Name(Expression):
    """A signal, by its name in the model."""

    name: str

    def __str__(self) -> str:
        return name_text(self.name)

    def _value(self, columns: Mapping[str, Any]) -> Any:
        return columns[self.name]


@dataclass(frozen=True, slots=True)
class Negative(Expression):
    """Unary minus."""

    operand: Expression
    binding: ClassVar[int] = SIGN

    @property
    def operands(self) -> tuple[Expression, ...]:
        """The operand."""
        return (self.operand,)

    def __str__(self) -> str:
        return f"-{embraced(self.operand, SIGN)}"

    def _value(self, columns: Mapping[str, Any]) -> Any:
        return -np.asarray(self.operand._value(columns), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Arithmetic(Expression):
    """Two expressions joined by ``+ - * / ^``."""

    operator: Operator
    left: Expression
    right: Expression

    @property
    def binding(self) -> int:  # type: ignore[override]
        """Precedence of the operator."""
        return {"+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT, "^": POWER}[self.operator]

    @property
    def operands(self) -> tuple[Expression, ...]:
        """Left and right side."""
        return (self.left, self.right)

    def __str__(self) -> str:
        if self.operator == "^":
            return f"{embraced(self.left, ATOM)}^{embraced(self.right, SIGN)}"
        left, right = embraced(self.left, self.binding), embraced(self.right, self.binding + 1)
        return f"{left} {self.operator} {right}" if self.binding == SUM else f"{left}{self.operator}{right}"

    def _value(self, columns: Mapping[str, Any]) -> Any:
        return OPERATORS[self.operator](self.left._value(columns), self.right._value(columns))


@dataclass(frozen=True, slots=True)
class Call(Expression):
    """A function of one expression, or the minimum or maximum of several."""

    function: Function
    operands: tuple[Expression, ...]

    def __str__(self) -> str:
        return f"{self.function}({', '.join(map(str, self.operands))})"

    def _value(self, columns: Mapping[str, Any]) -> Any:
        function, values = FUNCTIONS_OF[self.function], [each._value(columns) for each in self.operands]
        return function(values[0]) if len(values) == 1 else reduce(function, values)


# Added to a temperature, with either sign, they convert it: its unit is another one then. Beside the names of
# units of temperature, in lower case, "C" and "F" are often written for them.
_ZERO_POINTS = frozenset(("273", "273.15", "459.67"))
_TEMPERATURES = frozenset(("k", "kelvin", "degrk", *(
    f"{degree}{scale}" for degree in ("", "°", "deg", "deg ", "deg_", "degrees ")
    for scale in ("c", "f", "celsius", "fahrenheit")
)))  # fmt: skip
# Units of plain numbers, which fit any other, and functions whose value has the unit of their operands.
_PLAIN_UNITS, _KEEPING = ("1", "-"), ("abs", "min", "max")


def unit_of(expression: Expression, units: Mapping[str, str]) -> str:
    """Return the unit of an expression, given those of the signals; empty if it is not known."""
    match expression:
        case Name(name):
            unit = units.get(name, "")
            return "" if unit in _PLAIN_UNITS else unit
        case Arithmetic("*" | "/" | "^") | Number():
            return ""
        case Call(function) if function not in _KEEPING:
            return ""
    found = {unit_of(operand, units) for operand in expression.operands} - {""}
    unit = found.pop() if len(found) == 1 else ""
    if isinstance(expression, Arithmetic) and unit.lower() in _TEMPERATURES:
        return "" if _ZERO_POINTS & {str(each).lstrip("-") for each in expression.operands} else unit
    return unit


def embraced(part: Any, binding: int) -> str:
    """Return the text of a part, in parentheses if its precedence is lower than ``binding``."""
    return str(part) if part.binding >= binding else f"({part})"
