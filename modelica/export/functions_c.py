"""Modelica functions -> C functions. Inside of functions nothing makes events and array sizes may vary."""

from __future__ import annotations

from dataclasses import dataclass

from . import builtin, fold
from .evaluate import Evaluator, _type_of
from .instance import Scope
from .ir import FlatModel, Lit, Type
from .library import find_class, find_constant
from .print_c import C_TYPES, Layout, c_name, literal, operation_text
from .syntax import (
    ArrayOf,
    Assign,
    Body,
    Call,
    Choice,
    Class,
    Colon,
    Component,
    End,
    ExportError,
    Expr,
    For,
    If,
    Item,
    Jump,
    Number,
    Operation,
    Place,
    Range,
    Ref,
    Run,
    Several,
    Text,
    Truth,
    While,
)


@dataclass(frozen=True, slots=True)
class Value:
    """C text of a value; with dimensions it is a pointer to its elements."""

    text: str
    type: Type
    dims: tuple[str, ...] = ()


def functions_text(model: FlatModel, evaluator: Evaluator, layout: Layout) -> str:
    """Prototypes and definitions of all functions that the model needs."""
    done: dict[str, tuple[str, str]] = {}
    while pending := [name for name in model.functions if name not in done]:
        for name in pending:
            done[name] = FunctionWriter(model.functions[name], model, evaluator, layout).write()
    prototypes = [f"{head};" for head, _ in done.values()]
    bodies = [f"{head} {{\n{body}}}" for head, body in done.values()]
    return "\n".join(prototypes) + "\n\n" + "\n\n".join(bodies) + "\n"


class FunctionWriter:
    """Writes one function."""

    def __init__(self, cls: Class, model: FlatModel, evaluator: Evaluator, layout: Layout) -> None:
        if cls.extends or cls.equations or cls.initial_equations:
            raise ExportError(
                cls.place, f"the function '{cls.name}' may only have declarations and one algorithm"
            )
        if len(cls.algorithms) != 1:
            raise ExportError(cls.place, f"the function '{cls.name}' needs exactly one algorithm section")
        self.cls = cls
        self.model = model
        self.layout = layout
        self.constants = evaluator.at(Scope(None, cls))
        self.variables = {c.name: c for c in cls.components if c.variability != "constant"}
        self.indices: dict[str, Type] = {}
        self.sizes: list[str] = []
        outputs = [c for c in cls.components if c.causality == "output"]
        self.single = outputs[0] if len(outputs) == 1 and not outputs[0].dimensions else None
        self.outputs = outputs

    def write(self) -> tuple[str, str]:
        """Head and body."""
        parameters = ["Model *m"]
        lines: list[str] = []
        for item in self.cls.components:
            ctype = C_TYPES[_type_of(item)]
            if item.variability == "constant":
                continue
            if item.causality == "input":
                parameters.append(
                    f"const {ctype} *v_{item.name}" if item.dimensions else f"{ctype} v_{item.name}"
                )
                parameters += [f"int n_{item.name}_{k + 1}" for k in range(len(item.dimensions))]
            else:
                if item.causality == "output" and item is not self.single:
                    parameters.append(f"{ctype} *out_{item.name}")
                lines += self.local(item, ctype)
        body, place = self.cls.algorithms[0]
        lines += self.body(body)
        if "goto" in "\n".join(lines):
            lines.append("finish:;")
        lines += self.results()
        result = C_TYPES[_type_of(self.single)] if self.single else "void"
        text = "    (void)m;\n" + "".join(f"    {line}\n" for line in lines)
        return f"static {result} {c_name(self.cls.full_name)}({', '.join(parameters)})", text

    def local(self, item: Component, ctype: str) -> list[str]:
        """Declaration of an output or protected variable with its first value."""
        lines = []
        if not item.dimensions:
            value = self.converted(item.modifier.value, _type_of(item)) if item.modifier.value else "0"
            return [f"{ctype} v_{item.name} = {value};"]
        for k, dim in enumerate(item.dimensions):
            if isinstance(dim, Colon):
                raise ExportError(item.place, f"the size of '{item.name}' needs to be given")
            lines.append(f"const int n_{item.name}_{k + 1} = {self.integer(dim)};")
        count = " * ".join(f"n_{item.name}_{k + 1}" for k in range(len(item.dimensions)))
        if item.causality == "output":
            lines.append(f"{ctype} *v_{item.name} = out_{item.name};")
        else:
            lines.append(f"{ctype} v_{item.name}[{count}];")
        lines.append(f"for (int k = 0; k < {count}; k++) v_{item.name}[k] = 0;")
        if item.modifier.value:
            lines += self.copy(self.whole(item.name, item.place), self.value(item.modifier.value), item.place)
        return lines

    def results(self) -> list[str]:
        """Hand the outputs over."""
        if self.single:
            return [f"return v_{self.single.name};"]
        return [f"*out_{c.name} = v_{c.name};" for c in self.outputs if not c.dimensions]

    # ------------------------------------------------------------ statements

    def body(self, items: Body) -> list[str]:
        """A block of statements."""
        return [line for item in items for line in self.statement(item)]

    def statement(self, item: Item) -> list[str]:
        """One statement."""
        match item:
            case Assign(left, right, place):
                return self.assign(left, right, place)
            case Several(left, right, place):
                return self.several(left, right, place)
            case If(branches, otherwise, _):
                lines = []
                for k, (condition, body) in enumerate(branches):
                    word = "if" if k == 0 else "} else if"
                    lines += [f"{word} ({self.boolean(condition)}) {{", *self.indented(body)]
                return [*lines, "} else {", *self.indented(otherwise), "}"]
            case For():
                return self.loop(item)
            case While(condition, body, _):
                return [f"while ({self.boolean(condition)}) {{", *self.indented(body), "}"]
            case Jump(kind, _):
                return ["break;"] if kind == "break" else ["goto finish;"]
            case Run(call, place) if call.name == "assert" and isinstance(call.arguments[1], Text):
                message = c_string(f"{place}: {call.arguments[1].value}")
                return [f"if (!{self.boolean(call.arguments[0])}) model_fail(m, {message});"]
        raise ExportError(item.place, "this statement is not supported in a function")

    def indented(self, body: Body) -> list[str]:
        """A block inside of braces."""
        return ["    " + line for line in self.body(body)]

    def loop(self, item: For) -> list[str]:
        """A for loop over a range of Integers."""
        if not isinstance(item.over, Range):
            raise ExportError(item.place, "a for loop in a function runs over a range 'a:b' or 'a:step:b'")
        step = 1
        if item.over.step is not None:
            value = self.constants.static_integer(item.over.step, item.place)
            step = value or 1
        first, last = self.integer(item.over.first), self.integer(item.over.last)
        name = f"i_{item.index}"
        self.indices[item.index] = "Integer"
        lines = self.indented(item.body)
        del self.indices[item.index]
        test = "<=" if step > 0 else ">="
        head = f"for (int {name} = {first}, last_{name} = {last}; {name} {test} last_{name}; {name} += {step}) {{"
        return [head, *lines, "}"]

    def target(self, ref: Ref) -> Value:
        """The left side of an assignment."""
        name = ref.parts[0].name
        if name not in self.variables or len(ref.parts) > 1:
            raise ExportError(ref.place, f"there is no variable '{ref}' in the function '{self.cls.name}'")
        if self.variables[name].causality == "input":
            raise ExportError(ref.place, f"the input '{name}' cannot be assigned")
        return self.reference(ref)

    def assign(self, left: Ref, right: Expr, place: Place) -> list[str]:
        """`left := right`."""
        target = self.target(left)
        if not target.dims:
            return [f"{target.text} = {self.converted(right, target.type)};"]
        if isinstance(right, Call) and not builtin.known(right.name):
            return self.several((left,), right, place)
        return self.copy(target, self.value(right), place)

    def copy(self, target: Value, value: Value, place: Place) -> list[str]:
        """Array assignment, or a scalar into all elements."""
        count = " * ".join(target.dims)
        if target.type != value.type and (target.type, value.type) != ("Real", "Integer"):
            raise ExportError(place, f"expected {target.type}, found {value.type}")
        if not value.dims:
            raise ExportError(place, "expected an array, found a scalar; use fill(...)")
        if len(value.dims) != len(target.dims):
            raise ExportError(place, "the two sides of ':=' have different numbers of dimensions")
        size = " * ".join(value.dims)
        check = f"same_size(m, {count}, {size});"
        ctype = C_TYPES[value.type]
        return [
            check,
            f"{{ const {ctype} *from = {value.text}; {C_TYPES[target.type]} *to = {target.text}; "
            f"int n = {count}; if (to < ({C_TYPES[target.type]} *)from) for (int k = 0; k < n; k++) to[k] = from[k]; "
            f"else for (int k = n - 1; k >= 0; k--) to[k] = from[k]; }}",
        ]

    def several(self, left: tuple[Ref | None, ...], right: Expr, place: Place) -> list[str]:
        """`(a, b) := f(x)`."""
        if not isinstance(right, Call):
            raise ExportError(place, "the right side needs to be a function call")
        function, args = self.call_arguments(right)
        outputs = [c for c in function.components if c.causality == "output"]
        if len(left) > len(outputs):
            raise ExportError(place, f"'{function.name}' has {len(outputs)} outputs, not {len(left)}")
        lines, pointers = [], []
        for k, output in enumerate(outputs):
            ref = left[k] if k < len(left) else None
            if ref is None:
                if output.dimensions:
                    raise ExportError(place, "an array output cannot be left out here")
                lines.append(f"{C_TYPES[_type_of(output)]} unused_{k};")
                pointers.append(f"&unused_{k}")
                continue
            target = self.target(ref)
            if target.type != _type_of(output) or len(target.dims) != len(output.dimensions):
                raise ExportError(place, f"'{ref}' does not fit the output '{output.name}'")
            pointers.append(target.text if target.dims else f"&{target.text}")
        if len(outputs) == 1 and not outputs[0].dimensions:
            return (
                [f"{self.target(left[0]).text} = {c_name(function.full_name)}({', '.join(args)});"]
                if left[0]
                else []
            )
        return ["{ " + " ".join(lines) + f" {c_name(function.full_name)}({', '.join(args + pointers)}); }}"]

    # ------------------------------------------------------------ expressions

    def converted(self, expr: Expr, kind: Type) -> str:
        """A scalar of the wanted type."""
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
            raise ExportError(expr.place, "array arithmetic is not supported inside of functions, use a loop")
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
                    raise ExportError(place, "'end' can only stand inside of subscripts")
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
            raise ExportError(place, f"'{operator}' does not take {' and '.join(types)}")
        kind: Type = "Boolean" if logical or comparing else "Real"
        if kind == "Real" and operator not in ("/", "^") and set(types) == {"Integer"}:
            kind = "Integer"
        return Value(operation_text(operator.lstrip("."), [arg.text for arg in args], kind, types), kind)

    def array(self, expr: ArrayOf, wanted: Type | None = None) -> Value:
        """An array literal."""
        rows = [self.value(item) for item in expr.elements]
        if not rows or any(row.dims for row in rows):
            raise ExportError(
                expr.place,
                "inside of a function an empty array or a matrix needs to be a constant of the function",
            )
        kind: Type = "Real" if any(row.type == "Real" for row in rows) else rows[0].type
        if wanted == "Real" and kind == "Integer":
            kind = wanted
        texts = ", ".join(row.text for row in rows)
        return Value(f"(const {C_TYPES[kind]}[]){{{texts}}}", kind, (str(len(rows)),))

    def whole(self, name: str, place: Place) -> Value:
        """A variable of the function without subscripts."""
        if name in self.indices:
            return Value(f"i_{name}", self.indices[name])
        item = self.variables[name]
        dims = tuple(f"n_{name}_{k + 1}" for k in range(len(item.dimensions)))
        return Value(f"v_{name}", _type_of(item), dims)

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
        value = self.constants.package_constant(*found)
        texts = tuple(literal(item.value, value.type) for item in value.items if isinstance(item, Lit))
        if not value.dims:
            return Value(texts[0], value.type)
        return Value(self.layout.table(texts, value.type), value.type, tuple(map(str, value.dims)))

    def call_arguments(self, call: Call) -> tuple[Class, list[str]]:
        """The called function and the C texts of its inputs."""
        function = find_class(call.name, self.cls, call.place)
        if function.kind != "function":
            raise ExportError(call.place, f"'{call.name}' is not a function")
        self.model.functions[function.full_name] = function
        inputs = [c for c in function.components if c.causality == "input"]
        if len(call.arguments) > len(inputs):
            raise ExportError(
                call.place, f"'{call.name}' takes {len(inputs)} arguments, not {len(call.arguments)}"
            )
        given = dict(zip((c.name for c in inputs), call.arguments, strict=False))
        for name, expr in call.named:
            if name in given or name not in {c.name for c in inputs}:
                raise ExportError(call.place, f"'{call.name}' has no free argument '{name}'")
            given[name] = expr
        texts = ["m"]
        for item in inputs:
            source = given.get(item.name, item.modifier.value)
            if source is None:
                raise ExportError(call.place, f"the argument '{item.name}' of '{call.name}' is missing")
            if not item.dimensions:
                texts.append(self.converted(source, _type_of(item)))
                continue
            value = self.array(source, _type_of(item)) if isinstance(source, ArrayOf) else self.value(source)
            if value.type != _type_of(item) or len(value.dims) != len(item.dimensions):
                raise ExportError(
                    call.place, f"the argument '{item.name}' of '{call.name}' has another type or size"
                )
            texts += [value.text, *value.dims]
        return function, texts

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
        return Value(f"{c_name(function.full_name)}({', '.join(texts)})", _type_of(outputs[0]))

    def builtin(self, call: Call) -> Value:
        """A built-in function."""
        name, place = call.name, call.place
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
            raise ExportError(place, f"'{name}' of arrays is not supported inside of functions, use a loop")
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
            raise ExportError(place, f"'{name}' is not supported inside of functions")
        if len(args) != wanted or "Boolean" in types:
            raise ExportError(place, f"'{name}' takes {wanted} numbers")
        if name == "integer" and types == ["Real"]:
            texts = [f"floor({texts[0]})"]
        return Value(operation_text(name, texts, kind, types), kind)


def c_string(text: str) -> str:
    """A C string literal."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{escaped}"'
