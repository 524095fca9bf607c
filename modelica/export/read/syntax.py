"""The syntax tree of the supported part of Modelica. Every node has its file and line."""

from __future__ import annotations

from dataclasses import dataclass, field

LARGEST_INTEGER = 2**31 - 1
"""Integers of the exported C have 32 bits."""


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a Modelica file."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class ExportError(Exception):
    """Something in the Modelica text that cannot be exported; the message starts with file and line."""

    def __init__(self, place: Place | None, message: str) -> None:
        super().__init__(f"{place}: {message}" if place else message)
        self.place = place


@dataclass(frozen=True, slots=True)
class Number:
    """A literal; an int is a Modelica Integer."""

    value: float | int
    place: Place


@dataclass(frozen=True, slots=True)
class Truth:
    """`true` or `false`."""

    value: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Text:
    """A string literal (attributes and assertion messages only)."""

    value: str
    place: Place


@dataclass(frozen=True, slots=True)
class Part:
    """One part of a dotted name, with its subscripts."""

    name: str
    subscripts: tuple[Expr, ...] = ()


@dataclass(frozen=True, slots=True)
class Ref:
    """A dotted name."""

    parts: tuple[Part, ...]
    place: Place

    def __str__(self) -> str:
        return ".".join(part.name for part in self.parts)


@dataclass(frozen=True, slots=True)
class Call:
    """A call of a built-in operator or a function."""

    name: str
    arguments: tuple[Expr, ...]
    named: tuple[tuple[str, Expr], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Operation:
    """An operator with one or two operands."""

    operator: str
    operands: tuple[Expr, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Choice:
    """An if-expression: (condition, value) pairs and the value of else."""

    branches: tuple[tuple[Expr, Expr], ...]
    otherwise: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class ArrayOf:
    """`{a, b, c}`; a matrix `[a, b; c, d]` is an array of arrays."""

    elements: tuple[Expr, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Range:
    """`first:step:last`."""

    first: Expr
    step: Expr | None
    last: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Colon:
    """A bare `:` as a subscript or an unknown dimension."""

    place: Place


@dataclass(frozen=True, slots=True)
class End:
    """`end` as a subscript."""

    place: Place


Expr = Number | Truth | Text | Ref | Call | Operation | Choice | ArrayOf | Range | Colon | End


@dataclass(frozen=True, slots=True)
class Equal:
    """`left = right`."""

    left: Expr
    right: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Several:
    """`(a, b) = f(x)` as an equation or a statement; an omitted output is None."""

    left: tuple[Ref | None, ...]
    right: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Assign:
    """`left := right`."""

    left: Ref
    right: Expr
    place: Place


@dataclass(frozen=True, slots=True)
class Run:
    """A call as a statement or an equation: `assert`, `reinit`."""

    call: Call
    place: Place


@dataclass(frozen=True, slots=True)
class If:
    """If-equation or if-statement: (condition, body) pairs and the body of else."""

    branches: tuple[tuple[Expr, Body], ...]
    otherwise: Body
    place: Place


@dataclass(frozen=True, slots=True)
class For:
    """For-equation or for-statement over one index."""

    index: str
    over: Expr
    body: Body
    place: Place


@dataclass(frozen=True, slots=True)
class While:
    """While-statement."""

    condition: Expr
    body: Body
    place: Place


@dataclass(frozen=True, slots=True)
class When:
    """When-equation or when-statement with its elsewhen branches."""

    branches: tuple[tuple[Expr, Body], ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Jump:
    """`break` or `return`."""

    kind: str
    place: Place


Item = Equal | Several | Assign | Run | If | For | While | When | Jump


Body = tuple[Item, ...]


@dataclass(frozen=True, slots=True)
class Modifier:
    """What follows a name: `(start = 1, min = 0) = value`."""

    value: Expr | None = None
    inner: tuple[tuple[str, Modifier], ...] = ()
    place: Place | None = None
    each: bool = False
    final: bool = False


@dataclass(frozen=True, slots=True)
class Component:
    """One declared component."""

    name: str
    type_name: str
    dimensions: tuple[Expr, ...]
    variability: str  # "", "constant", "parameter", "discrete"
    causality: str  # "", "input", "output"
    modifier: Modifier
    description: str
    public: bool
    final: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Extends:
    """An extends clause."""

    name: str
    modifier: Modifier
    place: Place


@dataclass(frozen=True, slots=True)
class Import:
    """`import alias = name`, `import name`, `import name.*` (alias "*")."""

    alias: str
    name: str
    place: Place


@dataclass(slots=True)
class Class:
    """A class definition; `parent` is the enclosing class."""

    name: str
    kind: str
    description: str
    place: Place
    components: list[Component] = field(default_factory=list)
    classes: dict[str, Class] = field(default_factory=dict)
    extends: list[Extends] = field(default_factory=list)
    imports: list[Import] = field(default_factory=list)
    equations: list[Item] = field(default_factory=list)
    initial_equations: list[Item] = field(default_factory=list)
    algorithms: list[tuple[Body, Place]] = field(default_factory=list)
    annotation: Modifier = field(default_factory=Modifier)
    alias_of: Extends | None = None  # `type Speed = Real(unit="m/s")`
    alias_dimensions: tuple[Expr, ...] = ()
    literals: tuple[tuple[str, str], ...] = ()  # of an enumeration: names and descriptions
    partial: bool = False
    parent: Class | None = None

    @property
    def full_name(self) -> str:
        """The dotted name, starting with the outermost class."""
        return f"{self.parent.full_name}.{self.name}" if self.parent and self.parent.name else self.name
