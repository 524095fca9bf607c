"""The result of flattening: scalar expressions, equations and variables without class structure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from ..read.syntax import Class, Place

Type = str
"""`Real`, `Integer`, `Boolean`, or the full name of an enumeration."""

NUMBERS = frozenset(["Real", "Integer"])


def alike(one: Type, other: Type) -> bool:
    """Whether two types can be compared, equated or be branches of one `if`: numbers, or the same type."""
    return one == other or {one, other} == NUMBERS


@dataclass(frozen=True, slots=True)
class Lit:
    """A known value."""

    value: float | int | bool
    type: Type


@dataclass(frozen=True, slots=True)
class Var:
    """The value of a scalar variable."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Pre:
    """The value of a variable before the current event."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Der:
    """The time derivative of a state."""

    name: str
    type: Type = "Real"


@dataclass(frozen=True, slots=True)
class Time:
    """The simulation time."""

    type: Type = "Real"


@dataclass(frozen=True, slots=True)
class Initial:
    """True during initialization."""

    type: Type = "Boolean"


@dataclass(frozen=True, slots=True)
class Tick:
    """True at the instants start + k * interval, in the first iteration of the event."""

    start: Scalar
    interval: Scalar
    type: Type = "Boolean"


@dataclass(frozen=True, slots=True)
class Edge:
    """When-condition number `index` has just become true."""

    index: int
    type: Type = "Boolean"


@dataclass(frozen=True, slots=True)
class Op:
    """An operator or built-in function without events."""

    name: str
    args: tuple[Scalar, ...]
    type: Type


@dataclass(frozen=True, slots=True)
class Relation:
    """A comparison that creates a state or time event when it changes, and is frozen between events."""

    name: str
    left: Scalar
    right: Scalar
    type: Type = "Boolean"


@dataclass(frozen=True, slots=True)
class Floor:
    """The largest integer not above `arg`; creates an event when it changes."""

    arg: Scalar
    type: Type = "Real"


@dataclass(frozen=True, slots=True)
class Cond:
    """If-expression."""

    condition: Scalar
    then: Scalar
    otherwise: Scalar
    type: Type


@dataclass(frozen=True, slots=True)
class Pick:
    """An array element whose subscripts are known only during simulation."""

    array: Tensor
    subscripts: tuple[Scalar, ...]
    type: Type
    place: Place


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """A call of a Modelica function with one scalar result."""

    function: str
    args: tuple[Tensor, ...]
    type: Type


Scalar = (
    Lit | Var | Pre | Der | Time | Initial | Tick | Edge | Op | Relation | Floor | Cond | Pick | FunctionCall
)


@dataclass(frozen=True, slots=True)
class Tensor:
    """Scalars in row-major order; a scalar has no dimensions."""

    dims: tuple[int, ...]
    items: tuple[Scalar, ...]
    type: Type


def children(node: Scalar) -> Iterator[Scalar]:
    """Yield the direct operands of an expression."""
    match node:
        case Op():
            yield from node.args
        case Relation():
            yield node.left
            yield node.right
        case Floor():
            yield node.arg
        case Cond():
            yield node.condition
            yield node.then
            yield node.otherwise
        case Pick():
            yield from node.subscripts
            yield from node.array.items
        case FunctionCall():
            for tensor in node.args:
                yield from tensor.items
        case Tick():
            yield node.start
            yield node.interval


def walk(node: Scalar) -> Iterator[Scalar]:
    """Yield the expression and everything in it."""
    yield node
    for child in children(node):
        yield from walk(child)


@dataclass(frozen=True, slots=True)
class Equation:
    """`left = right`; `discrete` if it comes from a when clause."""

    left: Scalar
    right: Scalar
    place: Place
    discrete: bool = False


@dataclass(frozen=True, slots=True)
class Condition:
    """When-condition number `index`."""

    index: int
    value: Scalar
    place: Place


@dataclass(frozen=True, slots=True)
class Outputs:
    """`targets = function(args)`: all outputs of the function; an unused one is None."""

    targets: tuple[tuple[str, ...] | None, ...]
    function: str
    args: tuple[Tensor, ...]
    place: Place
    discrete: bool = False


@dataclass(frozen=True, slots=True)
class Reinit:
    """Set a state to `value` if `condition` holds."""

    state: str
    condition: Scalar
    value: Scalar
    place: Place


@dataclass(frozen=True, slots=True)
class Assert:
    """An error with `message` if `condition` does not hold."""

    condition: Scalar
    message: str
    place: Place


@dataclass(frozen=True, slots=True)
class DelayLine:
    """`out` is the value that `value` had when `key` was at `position`.

    Attributes:
        span: maximum distance of `position` behind `key`.
        seeds: initial content of the line as pairs of distance behind the first key and value, beginning
            with what comes out first. Without seeds, the first value comes out.
    """

    key: Var
    value: Var
    position: Var
    out: Var
    span: Scalar
    seeds: tuple[tuple[Scalar, Scalar], ...]
    place: Place

    @property
    def first(self) -> Scalar:
        """The value that comes out at the start."""
        return self.seeds[0][1] if self.seeds else self.value


def is_delayed(name: str) -> bool:
    """Whether a variable belongs to a delay line."""
    return name.startswith("$delay")


@dataclass(frozen=True, slots=True)
class Set:
    """Statement `name := value`."""

    name: str
    value: Scalar
    place: Place


@dataclass(frozen=True, slots=True)
class Branch:
    """If-statement."""

    branches: tuple[tuple[Scalar, tuple[Statement, ...]], ...]
    otherwise: tuple[Statement, ...]
    place: Place


Statement = Set | Branch | Outputs | Reinit | Assert | Condition


@dataclass(frozen=True, slots=True)
class Section:
    """An algorithm section of a model."""

    statements: tuple[Statement, ...]
    place: Place


Flat = Equation | Condition | Outputs | DelayLine | Reinit | Assert | Section


@dataclass(slots=True)
class Variable:
    """A scalar variable of the flat model."""

    name: str
    type: Type
    variability: Literal["parameter", "continuous", "discrete"]
    causality: Literal["input", "output", "local"]
    public: bool
    final: bool
    place: Place
    description: str = ""
    unit: str | None = None
    display_unit: str | None = None
    quantity: str | None = None
    minimum: float | int | None = None
    maximum: float | int | None = None
    nominal: float | None = None
    fixed: bool = False
    start: Scalar | None = None
    binding: Scalar | None = None  # parameters only


@dataclass(slots=True)
class FlatModel:
    """A model without class structure."""

    name: str
    description: str
    variables: dict[str, Variable] = field(default_factory=dict)
    equations: list[Flat] = field(default_factory=list)
    initial_equations: list[Equation] = field(default_factory=list)
    functions: dict[str, Class] = field(default_factory=dict)
    enumerations: dict[str, Class] = field(default_factory=dict)
    structural: set[str] = field(default_factory=set)
    conditions: int = 0
    stop_time: float | None = None
    interval: float | None = None
    tolerance: float | None = None
    solver: dict[str, float | str | bool] = field(default_factory=dict)


def names_in(node: Scalar) -> set[str]:
    """Return the names of variables and derivatives (`der(x)`) whose current value an expression needs."""
    found = set()
    for part in walk(node):
        if isinstance(part, Var):
            found.add(part.name)
        elif isinstance(part, Der):
            found.add(f"der({part.name})")
        elif isinstance(part, Edge):
            found.add(f"when({part.index})")
    return found


# Receives what is taken out of expressions.
Sink = Callable[[Outputs | Equation | DelayLine], None]
