"""Expressions in Modelica functions -> C."""

from __future__ import annotations

from dataclasses import dataclass

from ..flat import builtin, fold
from ..flat.evaluate import Evaluator
from ..flat.instance import Scope
from ..flat.ir import FlatModel, Lit, Tensor, Type
from ..flat.tensors import fitted, type_of
from ..order.layout import Layout, c_type, literal
from ..read.library import find_class, find_constant
from ..read.syntax import (
    ArrayOf,
    Call,
    Choice,
    Class,
    Colon,
    Component,
    End,
    ExportError,
    Expr,
    Number,
    Operation,
    Place,
    Ref,
    Truth,
)
from .expressions import c_name, operation_text


@dataclass(frozen=True, slots=True)
class Value:
    """C text of a value; if it has dimensions, a pointer to its elements."""

    text: str
    type: Type
    dims: tuple[str, ...] = ()


class Expressions:
    """Expressions in the scope of one function."""

    cls: Class
    model: FlatModel
    layout: Layout
    constants: Evaluator
    variables: dict[str, Component]
    indices: dict[str, Type]
    sizes: list[str]

    def converted(self, expr: Expr, kind: Type) -> str:
        """Print a scalar expression of this type; an Integer is accepted as Real."""
        value = self.scalar(expr)
        if value.type == kind or (kind == "Real" and value.type == "Integer"):
            return value.text
        raise ExportError(expr.place, f"expected {kind}, found {value.type}")

    def integer(self, expr: Expr) -> str:
        """A scalar Integer."""
        return self.converted(expr, "Integer")

    def boolean(self, expr: Expr) -> str:
        """A scalar Boolean."""
        return self.converted(expr, "Boolean")

    def scalar(self, expr: Expr) -> Value:
        """A scalar."""
        value = self.value(expr)
        if value.dims:
            raise ExportError(expr.place, "array arithmetic is not supported in functions; use a loop")
        return value

    def value(self, expr: Expr) -> Value:
        """Any expression."""
        match expr:
            case Number(number, _):
                kind: Type = "Integer" if isinstance(number, int) else "Real"
                return Value(literal(number, kind), kind)
            case Truth(truth, _):
                return Value(str(int(truth)), "Boolean")
            case Ref():
                return self.reference(expr)
            case ArrayOf():
                return self.array(expr)
            case Choice(branches, otherwise, place):
                result = self.scalar(otherwise)
                for condition, branch in reversed(branches):
                    value = self.scalar(branch)
                    if (value.type == "Boolean") != (result.type == "Boolean"):
                        raise ExportError(place, "the branches of 'if' have different types")
                    kind = value.type if value.type == result.type else "Real"
                    result = Value(f"({self.boolean(condition)} ? {value.text} : {result.text})", kind)
                return result
            case Operation(operator, operands, place):
                return self.operation(operator, [self.scalar(item) for item in operands], place)
            case Call():
                return self.call(expr)
            case End(place):
                if not self.sizes:
                    raise ExportError(place, "'end' is only allowed in subscripts")
                return Value(self.sizes[-1], "Integer")
        raise ExportError(expr.place, "this expression is not supported in a function")

    def operation(self, operator: str, args: list[Value], place: Place) -> Value:
        """An operator on scalars."""
        if len(args) == 1 and operator in "+-":
            if operator == "+":
                return args[0]
            operator = "neg"
        types: list[Type] = [arg.type for arg in args]
        logical = operator in ("and", "or", "not")
        comparing = operator in fold.COMPARISONS
        if logical != ("Boolean" in types) and not (comparing and set(types) == {"Boolean"}):
            raise ExportError(place, f"'{operator}' cannot be applied to {' and '.join(types)}")
        kind: Type = "Boolean" if logical or comparing else "Real"
        if kind == "Real" and operator not in ("/", "^") and set(types) == {"Integer"}:
            kind = "Integer"
        return Value(operation_text(operator.lstrip("."), [arg.text for arg in args], kind), kind)

    def array(self, expr: ArrayOf, wanted: Type | None = None) -> Value:
        """An array literal."""
        rows = [self.value(item) for item in expr.elements]
        if not rows or any(row.dims for row in rows):
            raise ExportError(
                expr.place,
                "an empty array or a matrix in a function must be declared as a constant of the function",
            )
        kind: Type = "Real" if any(row.type == "Real" for row in rows) else rows[0].type
        if wanted == "Real" and kind == "Integer":
            kind = wanted
        texts = ", ".join(row.text for row in rows)
        return Value(f"(const {c_type(kind)}[]){{{texts}}}", kind, (str(len(rows)),))

    def whole(self, name: str, place: Place) -> Value:
        """Return a variable of the function as a whole, without subscripts."""
        if name in self.indices:
            return Value(f"i_{name}", self.indices[name])
        item = self.variables[name]
        dims = tuple(f"n_{name}_{k + 1}" for k in range(len(item.dimensions)))
        return Value(f"v_{name}", type_of(item), dims)

    def reference(self, ref: Ref) -> Value:
        """A variable or constant with subscripts."""
        name = ref.parts[0].name
        if len(ref.parts) == 1 and (name in self.indices or name in self.variables):
            base = self.whole(name, ref.place)
        else:
            base = self.constant(ref)
        subscripts = ref.parts[-1].subscripts
        if not subscripts:
            return base
        if len(subscripts) != len(base.dims):
            raise ExportError(ref.place, f"'{ref}' needs {len(base.dims)} subscripts")
        kept = len(subscripts)
        while kept and isinstance(subscripts[kept - 1], Colon):
            kept -= 1
        index = "0"
        for k, text in enumerate(subscripts[:kept]):
            self.sizes.append(base.dims[k])
            step = f"subscript(m, {self.integer(text)}, {base.dims[k]}, {ref.place.line})"
            self.sizes.pop()
            index = step if index == "0" else f"({index}) * {base.dims[k]} + {step}"
        if kept == len(subscripts):
            return Value(f"{base.text}[{index}]", base.type)
        stride = " * ".join(base.dims[kept:])
        return Value(f"({base.text} + ({index}) * ({stride}))", base.type, base.dims[kept:])

    def constant(self, ref: Ref) -> Value:
        """A constant of the function or of a package."""
        found = find_constant(str(ref), self.cls)
        if found is None or found[0].variability != "constant":
            raise ExportError(
                ref.place, f"there is no variable or constant '{ref}' in the function '{self.cls.name}'"
            )
        return self.known(self.constants.package_constant(*found))

    def known(self, value: Tensor) -> Value:
        """A value that is known now."""
        texts = tuple(literal(item.value, value.type) for item in value.items if isinstance(item, Lit))
        if not value.dims:
            return Value(texts[0], value.type)
        return Value(self.layout.table(texts, value.type), value.type, tuple(map(str, value.dims)))

    def call_arguments(self, call: Call) -> tuple[Class, list[str]]:
        """Return the called function and the C texts of its inputs."""
        function = find_class(call.name, self.cls, call.place)
        if function.kind != "function":
            raise ExportError(call.place, f"'{call.name}' is not a function")
        self.model.functions[function.full_name] = function
        inputs = [c for c in function.components if c.causality == "input"]
        if len(call.arguments) > len(inputs):
            raise ExportError(
                call.place, f"'{call.name}' expects {len(inputs)} arguments, got {len(call.arguments)}"
            )
        given = dict(zip((c.name for c in inputs), call.arguments, strict=False))
        for name, expr in call.named:
            if name in given or name not in {c.name for c in inputs}:
                raise ExportError(call.place, f"'{call.name}' has no free argument '{name}'")
            given[name] = expr
        texts = ["m"]
        for item in inputs:
            source = given.get(item.name)
            if source is None:
                value = self.default(item, function, call)
            elif not item.dimensions:
                value = Value(self.converted(source, type_of(item)), type_of(item))
            elif isinstance(source, ArrayOf):
                value = self.array(source, type_of(item))
            else:
                value = self.value(source)
            if value.type != type_of(item) or len(value.dims) != len(item.dimensions):
                raise ExportError(
                    call.place, f"the argument '{item.name}' of '{call.name}' has another type or size"
                )
            texts += [value.text, *value.dims]
        return function, texts

    def default(self, item: Component, function: Class, call: Call) -> Value:
        """The value of an input that a call omits, in which names are those of the called function."""
        if item.modifier.value is None:
            raise ExportError(call.place, f"the argument '{item.name}' of '{call.name}' is missing")
        value = self.constants.at(Scope(None, function)).value(item.modifier.value)
        if not all(isinstance(part, Lit) for part in value.items):
            raise ExportError(item.place, f"the default of '{item.name}' is not known before simulation")
        return self.known(fitted(value, value.dims, type_of(item), item.place))

    def call(self, call: Call) -> Value:
        """A built-in or a function with one scalar result."""
        if builtin.known(call.name):
            return self.builtin(call)
        function, texts = self.call_arguments(call)
        outputs = [c for c in function.components if c.causality == "output"]
        if len(outputs) != 1 or outputs[0].dimensions:
            raise ExportError(
                call.place, f"'{call.name}' has an array or several outputs; assign them to variables"
            )
        return Value(f"{c_name(function.full_name)}({', '.join(texts)})", type_of(outputs[0]))

    def builtin(self, call: Call) -> Value:
        """A built-in function."""
        name, place = call.name, call.place
        if not call.arguments:
            raise ExportError(place, f"'{name}' needs arguments")
        if name == "size" and len(call.arguments) == 2:
            dims = self.value(call.arguments[0]).dims
            index = self.constants.static_integer(call.arguments[1], place)
            if not 1 <= index <= len(dims):
                raise ExportError(place, f"there is no dimension {index}")
            return Value(dims[index - 1], "Integer")
        if name == "noEvent":
            return self.scalar(call.arguments[0])
        args = [self.value(item) for item in call.arguments]
        if (
            name in ("sum", "min", "max", "product")
            and len(args) == 1
            and len(args[0].dims) == 1
            and args[0].type == "Real"
        ):
            return Value(f"{name}_of({args[0].text}, {args[0].dims[0]})", "Real")
        if any(arg.dims for arg in args):
            raise ExportError(place, f"'{name}' of arrays is not supported in functions; use a loop")
        types: list[Type] = [arg.type for arg in args]
        texts = [arg.text for arg in args]
        if name in fold.REAL_FUNCTIONS:
            wanted = 2 if name == "atan2" else 1
            kind: Type = "Real"
        elif name in ("abs", "sign", "floor", "ceil", "integer"):
            wanted, kind = 1, "Integer" if name in ("sign", "integer") or types[:1] == ["Integer"] else "Real"
        elif name in ("min", "max", "div", "mod", "rem"):
            wanted, kind = 2, "Integer" if set(types) == {"Integer"} else "Real"
        else:
            raise ExportError(place, f"'{name}' is not supported in functions")
        if len(args) != wanted or "Boolean" in types:
            raise ExportError(place, f"'{name}' expects {wanted} numeric arguments")
        if name == "integer" and types == ["Real"]:
            texts = [f"floor({texts[0]})"]
        return Value(operation_text(name, texts, kind), kind)
