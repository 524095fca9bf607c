"""Syntax tree of expressions -> scalar expressions: names resolved, arrays expanded, constants computed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import floor, prod

from ..read.library import enumeration, find_class, find_constant, lookup
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
    Part,
    Place,
    Range,
    Ref,
    Text,
    Truth,
)
from . import builtin, fold
from .calls import arguments, function_outputs, lifted
from .instance import Bound, Leaf, Node, NodeArray, Scope
from .ir import (
    Cond,
    FlatModel,
    FunctionCall,
    Lit,
    Op,
    Pick,
    Relation,
    Scalar,
    Sink,
    Tensor,
    Time,
    Type,
    Var,
)
from .tensors import element, fitted, scalar_tensor, selected, stacked, tensor, type_of


class Evaluator:
    """Evaluates expressions in one scope.

    Attributes:
        events: whether relations create events (not inside `noEvent`, when bodies and initial values).
        sink: receives what is taken out of expressions: calls of functions with array results or several
            outputs, and delay lines with their equations.
    """

    def __init__(
        self, model: FlatModel, scope: Scope, *, events: bool = False, sink: Sink | None = None
    ) -> None:
        self.model = model
        self.scope = scope
        self.events = events
        self.sink = sink
        self.leaves: dict[str, tuple[Leaf, int]] = {}
        self.constants: dict[int, Tensor] = {}
        self.bindings: dict[str, Tensor] = {}
        self._busy: set[str] = set()
        self._sizes: list[int] = []

    def at(self, scope: Scope, *, events: bool = False, sink: Sink | None = None) -> Evaluator:
        """Return an evaluator of the same model for another scope."""
        other = Evaluator(self.model, scope, events=events, sink=sink)
        other.leaves, other.constants, other.bindings = self.leaves, self.constants, self.bindings
        other._busy = self._busy
        return other

    @contextmanager
    def without_events(self) -> Iterator[None]:
        """Evaluate relations without events within this context."""
        before, self.events = self.events, False
        yield
        self.events = before

    # ---------------------------------------------------------------- values

    def bound(self, bound: Bound) -> Tensor:
        """Evaluate a modifier."""
        value = self.at(bound.scope).value(bound.expr)
        if bound.indices:
            if len(value.dims) < len(bound.indices):
                raise ExportError(
                    bound.place, "a modifier for an array of components needs 'each' or an array value"
                )
            return element(value, bound.indices, bound.place)
        return value

    def scalar(self, expr: Expr) -> Scalar:
        """Evaluate an expression that must be scalar."""
        value = self.value(expr)
        if value.dims:
            raise ExportError(expr.place, f"expected a scalar, found an array of size {list(value.dims)}")
        return value.items[0]

    def value(self, expr: Expr) -> Tensor:
        """Evaluate any expression."""
        match expr:
            case Number(value, _):
                return scalar_tensor(Lit(value, "Integer" if isinstance(value, int) else "Real"))
            case Truth(value, _):
                return scalar_tensor(Lit(value, "Boolean"))
            case Text(_, place):
                raise ExportError(place, "a string is not allowed here")
            case Ref():
                return self.reference(expr)
            case ArrayOf(elements, place):
                return stacked([self.value(item) for item in elements], place)
            case Range():
                return self.range(expr)
            case Choice():
                return self.choice(expr)
            case Operation(operator, operands, place):
                return builtin.operation(
                    operator, [self.value(item) for item in operands], place, events=self.events
                )
            case Call():
                return self.call(expr)
            case End(place):
                if not self._sizes:
                    raise ExportError(place, "'end' is only allowed in subscripts")
                return scalar_tensor(Lit(self._sizes[-1], "Integer"))
            case Colon(place):
                raise ExportError(place, "':' is only allowed as a subscript")

    def range(self, expr: Range) -> Tensor:
        """Evaluate `first:step:last`, whose bounds must be known before simulation."""
        parts = [expr.first, expr.step or Number(1, expr.place), expr.last]
        values = [self.static(self.scalar(part), expr.place) for part in parts]
        first, step, last = (value.value for value in values)
        if step == 0:
            raise ExportError(expr.place, "the step of a range must not be 0")
        count = max(0, floor((last - first) / step + 1e-9) + 1)
        kind: Type = "Integer" if all(value.type == "Integer" for value in values) else "Real"
        return Tensor((count,), tuple(Lit(first + k * step, kind) for k in range(count)), kind)

    def choice(self, expr: Choice) -> Tensor:
        """Evaluate an if-expression; branches that are known to be unreachable are skipped."""
        pending: list[tuple[Scalar, Tensor]] = []
        for condition_text, value_text in expr.branches:
            condition = self.scalar(condition_text)
            if isinstance(condition, Lit) and not condition.value:
                continue
            value = self.value(value_text)
            if isinstance(condition, Lit):
                result = value
                break
            pending.append((condition, value))
        else:
            result = self.value(expr.otherwise)
        for condition, value in reversed(pending):
            if value.dims != result.dims:
                raise ExportError(expr.place, "the branches of 'if' have different sizes")
            pairs = zip(value.items, result.items, strict=True)
            result = tensor(value.dims, [fold.choose(condition, a, b, expr.place) for a, b in pairs])
        return result

    # ---------------------------------------------------------------- names

    def reference(self, ref: Ref) -> Tensor:
        """Evaluate a name."""
        first = ref.parts[0]
        if first.name in self.scope.local:
            if len(ref.parts) > 1:
                raise ExportError(ref.place, f"'{ref}' has no components")
            return self.subscript(self.scope.local[first.name], first.subscripts, ref.place)
        if self.scope.node and first.name in self.scope.node.elements:
            return self.member(self.scope.node, ref.parts, ref.place)
        if str(ref) == "time":
            return scalar_tensor(Time())
        if (item := self.enumeration_item(ref)) is not None:
            return item
        found = find_constant(str(ref), self.scope.cls)
        if found is None or any(part.subscripts for part in ref.parts[:-1]):
            raise ExportError(ref.place, f"there is no variable '{ref}' in '{self.scope.cls.full_name}'")
        component, owner = found
        if component.variability != "constant":
            raise ExportError(ref.place, f"'{ref}' is neither a variable of the model nor a constant")
        return self.subscript(self.package_constant(component, owner), ref.parts[-1].subscripts, ref.place)

    def enumeration_item(self, ref: Ref) -> Tensor | None:
        """Return `Colour.red`, or None if the name before the last dot is not an enumeration."""
        names = [part.name for part in ref.parts]
        cls = enumeration(lookup(".".join(names[:-1]), self.scope.cls)) if len(names) > 1 else None
        if cls is None:
            return None
        items = [name for name, _ in cls.literals]
        if names[-1] not in items or any(part.subscripts for part in ref.parts):
            raise ExportError(ref.place, f"'{cls.name}' has no item '{names[-1]}'; it has {', '.join(items)}")
        self.model.enumerations[cls.full_name] = cls
        return scalar_tensor(Lit(items.index(names[-1]) + 1, cls.full_name))

    def package_constant(self, component: Component, owner: Class) -> Tensor:
        """Return the value of a constant that is declared in a package."""
        key = id(component)
        if key not in self.constants:
            text, place = component.modifier.value, component.place
            if text is None:
                raise ExportError(place, f"the constant '{component.name}' has no value")
            scope = self.at(Scope(None, owner))
            value = scope.value(text)
            if not all(isinstance(item, Lit) for item in value.items):
                raise ExportError(place, f"the value of '{component.name}' is not known before simulation")
            sizes = [
                isinstance(dim, Colon) or scope.static_integer(dim, place) for dim in component.dimensions
            ]
            dims = tuple(n if size is True else size for n, size in zip(value.dims, sizes, strict=False))
            if len(sizes) != len(dims):
                dims = tuple(int(size) for size in sizes)
            self.constants[key] = fitted(value, dims, type_of(component), place)
        return self.constants[key]

    def member(self, node: Node, parts: tuple[Part, ...], place: Place) -> Tensor:
        """Evaluate a component of an instance."""
        part, rest = parts[0], parts[1:]
        if part.name not in node.elements:
            raise ExportError(place, f"'{node.cls.full_name}' has no component '{part.name}'")
        child = node.child(part.name)
        if isinstance(child, Leaf):
            if rest:
                raise ExportError(place, f"'{part.name}' is a {child.type} and has no components")
            return self.subscript(self.leaf(child), part.subscripts, place)
        if not rest:
            raise ExportError(place, f"'{part.name}' is a component of a class and has no value of its own")
        if isinstance(child, Node):
            if part.subscripts:
                raise ExportError(place, f"'{part.name}' is not an array")
            return self.member(child, rest, place)
        return self.element_member(child, part, rest, place)

    def element_member(self, array: NodeArray, part: Part, rest: tuple[Part, ...], place: Place) -> Tensor:
        """Evaluate `car[2].v`, `car.v` or `car[1:3].v`."""
        count = prod(array.dims)
        numbers = Tensor(array.dims, tuple(Lit(k, "Integer") for k in range(count)), "Integer")
        chosen = self.subscript(numbers, part.subscripts, place)
        values = []
        for item in chosen.items:
            if not isinstance(item, Lit):
                raise ExportError(place, f"the subscript of '{part.name}' must be known before simulation")
            values.append(self.member(array.nodes[int(item.value)], rest, place))
        return Tensor(
            chosen.dims + (values[0].dims if values else ()),
            tuple(item for value in values for item in value.items),
            values[0].type if values else "Real",
        )

    def leaf(self, leaf: Leaf) -> Tensor:
        """Return the variables of a leaf, or its values if it is a constant."""
        if leaf.variability == "constant":
            value = self.binding(leaf)
            if all(isinstance(item, Lit) for item in value.items):
                return value
        return Tensor(leaf.dims, tuple(Var(name, leaf.type) for name in leaf.scalars()), leaf.type)

    def binding(self, leaf: Leaf) -> Tensor:
        """Return the value of a parameter or constant as an expression."""
        if leaf.name not in self.bindings:
            place = leaf.component.place
            if leaf.name in self._busy:
                raise ExportError(place, f"the value of '{leaf.name}' depends on itself")
            self._busy.add(leaf.name)
            source = leaf.mods.value or (
                leaf.mods.inner["start"].value if "start" in leaf.mods.inner else None
            )
            if source is None:
                raise ExportError(place, f"the {leaf.variability} '{leaf.name}' has no value")
            self.bindings[leaf.name] = fitted(self.bound(source), leaf.dims, leaf.type, source.place)
        return self.bindings[leaf.name]

    def subscript(self, value: Tensor, subscripts: tuple[Expr, ...], place: Place) -> Tensor:
        """Apply subscripts."""
        if not subscripts:
            return value
        if len(subscripts) > len(value.dims):
            raise ExportError(
                place, f"{len(subscripts)} subscripts for an array with {len(value.dims)} dimensions"
            )
        chosen: list[Tensor] = []
        for text, size in zip(subscripts, value.dims, strict=False):
            self._sizes.append(size)
            everything = Tensor((size,), tuple(Lit(k + 1, "Integer") for k in range(size)), "Integer")
            chosen.append(everything if isinstance(text, Colon) else self.value(text))
            self._sizes.pop()
        if any(index.type != "Integer" for index in chosen):
            raise ExportError(place, "subscripts must be Integers")
        if all(isinstance(item, Lit) for index in chosen for item in index.items):
            return selected(value, chosen, place)
        if any(index.dims for index in chosen) or len(chosen) < len(value.dims):
            raise ExportError(
                place, "a subscript that changes during simulation must select a single element"
            )
        return scalar_tensor(Pick(value, tuple(index.items[0] for index in chosen), value.type, place))

    # ---------------------------------------------------------------- calls

    def call(self, call: Call) -> Tensor:
        """Evaluate a call of a built-in operator or a function."""
        if builtin.known(call.name):
            return builtin.call(self, call)
        function = find_class(call.name, self.scope.cls, call.place)
        if function.kind != "function":
            raise ExportError(call.place, f"'{call.name}' is not a function")
        outputs = function_outputs(function, call)
        args = arguments(self, function, call)
        name = function.full_name
        self.model.functions[name] = function
        if len(outputs) == 1 and not outputs[0].dimensions:
            return scalar_tensor(FunctionCall(name, args, type_of(outputs[0])))
        return lifted(self, function, args, call.place)[0]

    # ---------------------------------------------------------------- known now

    def static(self, value: Scalar, place: Place) -> Lit:
        """Compute a value that must be known before simulation; parameters in it become structural."""
        match value:
            case Lit():
                return value
            case Var(name, _) if name in self.leaves and self.leaves[name][0].variability in (
                "parameter",
                "constant",
            ):
                leaf, index = self.leaves[name]
                self.model.structural.add(name)
                return self.static(self.binding(leaf).items[index], place)
            case Op(name, args, _):
                known = tuple(self.static(arg, place) for arg in args)
                result = builtin.recompute(name, known, place)
                if isinstance(result, Lit):
                    return result
            case Relation(name, left, right, _):
                return self.static(Op(name, (left, right), "Boolean"), place)
            case Cond(condition, then, otherwise, _):
                return self.static(then if self.static(condition, place).value else otherwise, place)
        raise ExportError(place, "this value must be known before simulation")

    def parametric(self, value: Scalar) -> bool:
        """Whether a value is known when the simulation starts, being made of parameters and literals."""
        match value:
            case Lit():
                return True
            case Var(name, _):
                return name in self.leaves and self.leaves[name][0].variability in ("parameter", "constant")
            case Op(_, args, _):
                return all(self.parametric(arg) for arg in args)
        return False

    def static_integer(self, expr: Expr, place: Place) -> int:
        """Compute a size or other integer that must be known before simulation."""
        result = self.static(self.scalar(expr), place)
        if result.type != "Integer":
            raise ExportError(place, "expected an Integer")
        return int(result.value)
