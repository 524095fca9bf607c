"""Modelica functions -> C functions. Functions create no events, and their array sizes may vary."""

from __future__ import annotations

from ..flat import builtin
from ..flat.evaluate import Evaluator
from ..flat.instance import Scope
from ..flat.ir import FlatModel, Type
from ..flat.parts import assertion_message
from ..flat.tensors import type_of
from ..order.layout import Layout, c_type
from ..read.syntax import (
    Assign,
    Body,
    Call,
    Class,
    Colon,
    Component,
    ExportError,
    Expr,
    For,
    If,
    Item,
    Jump,
    Place,
    Range,
    Ref,
    Run,
    Several,
    While,
)
from .expressions import c_name, c_string
from .function_expressions import Expressions, Value


def functions_text(model: FlatModel, evaluator: Evaluator, layout: Layout) -> str:
    """Return prototypes and definitions of all functions that the model needs."""
    done: dict[str, tuple[str, str]] = {}
    while pending := [name for name in model.functions if name not in done]:
        for name in pending:
            done[name] = FunctionWriter(model.functions[name], model, evaluator, layout).write()
    prototypes = [f"{head};" for head, _ in done.values()]
    bodies = [f"{head} {{\n{body}}}" for head, body in done.values()]
    return "\n".join(prototypes) + "\n\n" + "\n\n".join(bodies) + "\n"


class FunctionWriter(Expressions):
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
        """Return the head and the body of the C function."""
        parameters = ["Model *m"]
        lines: list[str] = []
        for item in self.cls.components:
            ctype = c_type(type_of(item))
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
                    parameters += [f"int to_{item.name}"] * bool(item.dimensions)
                lines += self.local(item, ctype)
        body, _ = self.cls.algorithms[0]
        lines += self.body(body)
        if "goto" in "\n".join(lines):
            lines.append("finish:;")
        lines += self.results()
        result = c_type(type_of(self.single)) if self.single else "void"
        text = "    (void)m;\n" + "".join(f"    {line}\n" for line in lines)
        return f"static {result} {c_name(self.cls.full_name)}({', '.join(parameters)})", text

    def local(self, item: Component, ctype: str) -> list[str]:
        """Print the declaration of an output or protected variable with its initial value."""
        lines = []
        if not item.dimensions:
            value = self.converted(item.modifier.value, type_of(item)) if item.modifier.value else "0"
            return [f"{ctype} v_{item.name} = {value};"]
        for k, dim in enumerate(item.dimensions):
            if isinstance(dim, Colon):
                raise ExportError(item.place, f"the size of '{item.name}' must be given")
            lines.append(f"const int n_{item.name}_{k + 1} = {self.integer(dim)};")
        count = " * ".join(f"n_{item.name}_{k + 1}" for k in range(len(item.dimensions)))
        lines.append(f"{ctype} v_{item.name}[{count}];")
        lines.append(f"for (int k = 0; k < {count}; k++) v_{item.name}[k] = 0;")
        if item.modifier.value:
            lines += self.copy(self.whole(item.name, item.place), self.value(item.modifier.value), item.place)
        return lines

    def results(self) -> list[str]:
        """Print the statements that return the outputs."""
        if self.single:
            return [f"return v_{self.single.name};"]
        lines = []
        for c in self.outputs:
            if not c.dimensions:
                lines.append(f"*out_{c.name} = v_{c.name};")
                continue
            # Copied at the end, because the result may be assigned to an argument: x := f(x).
            count = " * ".join(self.whole(c.name, c.place).dims)
            lines.append(f"same_size(m, to_{c.name}, {count});")
            lines.append(
                f"for (int k = 0; k < to_{c.name} && k < {count}; k++) out_{c.name}[k] = v_{c.name}[k];"
            )
        return lines

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
            case Run(call, place) if call.name == "assert":
                message = c_string(f"{place}: {assertion_message(call)}")
                return [f"if (!{self.boolean(call.arguments[0])}) model_fail(m, {message});"]
        raise ExportError(item.place, "this statement is not supported in a function")

    def indented(self, body: Body) -> list[str]:
        """Print the indented block between braces."""
        return ["    " + line for line in self.body(body)]

    def loop(self, item: For) -> list[str]:
        """Print a for loop over a range of Integers."""
        if not isinstance(item.over, Range):
            raise ExportError(item.place, "a for loop in a function needs a range 'a:b' or 'a:step:b'")
        if item.index in self.indices:
            raise ExportError(item.place, f"the index '{item.index}' is already that of an outer loop")
        step = 1
        if item.over.step is not None:
            value = self.constants.static_integer(item.over.step, item.place)
            if not (step := value):
                raise ExportError(item.place, "the step of a range must not be 0")
        first, last = self.integer(item.over.first), self.integer(item.over.last)
        name = f"i_{item.index}"
        self.indices[item.index] = "Integer"
        lines = self.indented(item.body)
        del self.indices[item.index]
        test = "<=" if step > 0 else ">="
        begin = f"int {name} = {first}, last_{name} = {last}"
        return [f"for ({begin}; {name} {test} last_{name}; {name} += {step}) {{", *lines, "}"]

    def target(self, ref: Ref) -> Value:
        """Return the left side of an assignment."""
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
        """Print an array assignment; the order of copying allows overlapping rows of one matrix."""
        count = " * ".join(target.dims)
        if target.type != value.type and (target.type, value.type) != ("Real", "Integer"):
            raise ExportError(place, f"expected {target.type}, found {value.type}")
        if not value.dims:
            raise ExportError(place, "expected an array, found a scalar; use fill(...)")
        if len(value.dims) != len(target.dims):
            raise ExportError(place, "the two sides of ':=' have different numbers of dimensions")
        checks = [f"same_size(m, {a}, {b});" for a, b in zip(target.dims, value.dims, strict=True)]
        source, goal = c_type(value.type), c_type(target.type)
        return [
            *checks,
            f"{{ const {source} *from = {value.text}; {goal} *to = {target.text}; int n = {count};",
            f"  if (to < ({goal} *)from) for (int k = 0; k < n; k++) to[k] = from[k];",
            "  else for (int k = n - 1; k >= 0; k--) to[k] = from[k]; }",
        ]

    def several(self, left: tuple[Ref | None, ...], right: Expr, place: Place) -> list[str]:
        """`(a, b) := f(x)`."""
        if not isinstance(right, Call):
            raise ExportError(place, "the right side must be a function call")
        function, args = self.call_arguments(right)
        outputs = [c for c in function.components if c.causality == "output"]
        if len(left) > len(outputs):
            raise ExportError(
                place, f"'{function.name}' has {len(outputs)} outputs, but {len(left)} are assigned"
            )
        lines, pointers = [], []
        for k, output in enumerate(outputs):
            ref = left[k] if k < len(left) else None
            if ref is None:
                if output.dimensions:
                    raise ExportError(place, "an array output cannot be omitted here")
                lines.append(f"{c_type(type_of(output))} unused_{k};")
                pointers.append(f"&unused_{k}")
                continue
            target = self.target(ref)
            if target.type != type_of(output) or len(target.dims) != len(output.dimensions):
                raise ExportError(
                    place, f"'{ref}' does not have the type and dimensions of the output '{output.name}'"
                )
            pointers += [target.text, " * ".join(target.dims)] if target.dims else [f"&{target.text}"]
        if len(outputs) == 1 and not outputs[0].dimensions:
            return (
                [f"{self.target(left[0]).text} = {c_name(function.full_name)}({', '.join(args)});"]
                if left[0]
                else []
            )
        return ["{ " + " ".join(lines) + f" {c_name(function.full_name)}({', '.join(args + pointers)}); }}"]
