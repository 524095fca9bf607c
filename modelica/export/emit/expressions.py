"""Scalar expressions -> C text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..flat.ir import (
    Cond,
    Der,
    Edge,
    Floor,
    FunctionCall,
    Initial,
    Lit,
    Op,
    Pick,
    Pre,
    Relation,
    Scalar,
    Tensor,
    Tick,
    Time,
    Type,
    Var,
)
from ..order.layout import Layout, c_type, literal

Mode = Literal["continuous", "event", "initial"]
"""Mode of the generated code: relations are frozen in continuous mode, evaluated in the other two."""


_C_FUNCTIONS = {
    "sqrt",
    "exp",
    "log",
    "log10",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "sinh",
    "cosh",
    "tanh",
}


def c_name(full_name: str) -> str:
    """Return the C name of a Modelica function."""
    return "fn_" + full_name.replace(".", "_")


@dataclass(frozen=True, slots=True)
class Printer:
    """Prints expressions for one mode."""

    layout: Layout
    mode: Mode

    def text(self, node: Scalar) -> str:
        """Return the C text of an expression."""
        match node:
            case Lit(value, kind):
                return literal(value, kind)
            case Var(name, _):
                return self.layout.slots[name]
            case Der(name):
                return self.layout.slots[f"der({name})"]
            case Pre(name, _):
                return self.layout.before[name]
            case Time():
                return "m->time"
            case Initial():
                return "1" if self.mode == "initial" else "0"
            case Edge(index):
                return "0" if self.mode == "initial" else f"(m->w[{index - 1}] && !m->pw[{index - 1}])"
            case Tick(start, interval):
                return "0" if self.mode == "initial" else f"m->tick[{self.layout.ticks[start, interval]}]"
            case Relation():
                return self.relation(node)
            case Floor(arg):
                if self.mode == "continuous" and arg in self.layout.floors:
                    return f"m->fl[{self.layout.floors[arg]}]"
                return f"floor({self.text(arg)})"
            case Cond(condition, then, otherwise, _):
                return f"({self.text(condition)} ? {self.text(then)} : {self.text(otherwise)})"
            case Pick():
                return self.pick(node)
            case FunctionCall(name, args, _):
                return (
                    f"{c_name(name)}(m{''.join(', ' + text for arg in args for text in self.argument(arg))})"
                )
            case Op():
                return self.operation(node)

    def relation(self, node: Relation) -> str:
        """Print a comparison: evaluated at events, its stored value between them."""
        if self.mode == "continuous":
            if node in self.layout.relations:
                return f"m->rel[{self.layout.relations[node]}]"
            if node in self.layout.time_relations:
                passed = f"m->trel[{self.layout.time_relations[node]}]"
                return passed if _time_after(node) else f"(!{passed})"
        left, right = self.text(node.left), self.text(node.right)
        if node in self.layout.time_relations:
            late = isinstance(node.left, Time)
            threshold = right if late else left
            return f"({'' if _time_after(node) else '!'}time_reached(m, {threshold}))"
        return f"({left} {node.name} {right})"

    def operation(self, node: Op) -> str:
        """Operators and elementary functions."""
        args = [self.text(arg) for arg in node.args]
        return operation_text(node.name, args, node.type)

    def pick(self, node: Pick) -> str:
        """Print an array element whose subscripts are known only during simulation."""
        base, *_ = self.argument(node.array)
        index = "0"
        for subscript, size in zip(node.subscripts, node.array.dims, strict=True):
            step = f"subscript(m, {self.text(subscript)}, {size}, {node.place.line})"
            index = step if index == "0" else f"({index}) * {size} + {step}"
        return f"({base})[{index}]"

    def argument(self, value: Tensor) -> list[str]:
        """Print a function argument: a scalar, or a pointer followed by the dimensions."""
        if not value.dims:
            return [self.text(value.items[0])]
        return [self.pointer(value), *map(str, value.dims)]

    def pointer(self, value: Tensor) -> str:
        """Print a pointer to the elements of an array in row-major order."""
        if all(isinstance(item, Lit) for item in value.items):
            texts = tuple(literal(item.value, value.type) for item in value.items if isinstance(item, Lit))
            return self.layout.table(texts, value.type)
        places = [
            self.layout.offsets.get(item.name) if isinstance(item, Var) else None for item in value.items
        ]
        first = places[0]
        if first and all(p == (first[0], first[1] + k) for k, p in enumerate(places)):
            return f"&{first[0]}[{first[1]}]"
        return f"(const {c_type(value.type)}[]){{{', '.join(self.text(item) for item in value.items)}}}"


def _time_after(node: Relation) -> bool:
    """Whether the relation becomes true, rather than false, as time passes."""
    return (node.name in (">", ">=")) == isinstance(node.left, Time)


def operation_text(name: str, args: list[str], kind: Type) -> str:
    """Return an operator or elementary function applied to C texts."""
    suffix = "int" if kind != "Real" else "real"
    match name, args:
        case "neg", [a]:
            return f"(-{a})"
        case "not", [a]:
            return f"(!{a})"
        case "and", [a, b]:
            return f"({a} && {b})"
        case "or", [a, b]:
            return f"({a} || {b})"
        case "<>", [a, b]:
            return f"({a} != {b})"
        case "/", [a, b]:
            return f"({a} / (double){b})"
        case "^", [a, b]:
            return f"square({a})" if b in ("2", "2.0") else f"pow({a}, {b})"
        case "ordinal", [a]:
            return a
        case "real", [a]:
            return f"((double){a})"
        case "integer", [a]:
            return f"((int){a})"
        case (("floor" | "ceil"), [a]):
            return f"{name}({a})"
        case "abs", [a]:
            return f"fabs({a})" if kind == "Real" else f"abs({a})"
        case "sign", [a]:
            return f"sign_of({a})"
        case (("min" | "max" | "div" | "mod" | "rem"), [a, b]):
            return f"{name}_{suffix}({a}, {b})"
    if name in _C_FUNCTIONS:
        return f"{name}({', '.join(args)})"
    a, b = args
    return f"({a} {name} {b})"


def c_string(text: str) -> str:
    """A C string literal."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{escaped}"'
