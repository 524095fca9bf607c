"""The instance tree: classes with their modifiers applied; components are created on demand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import product
from math import prod
from typing import Protocol

from ..read.library import BUILTIN_TYPES, base_classes, find_class
from ..read.syntax import Class, Colon, Component, ExportError, Expr, Modifier, Place
from .ir import FlatModel, Lit, Scalar, Sink, Tensor, Type

ATTRIBUTES = frozenset(
    ["start", "fixed", "min", "max", "nominal", "unit", "displayUnit", "quantity", "stateSelect"]
)


@dataclass(frozen=True, slots=True)
class Scope:
    """Where names are looked up: an instance, the class that contains the text, known local values."""

    node: Node | None
    cls: Class
    local: dict[str, Tensor] = field(default_factory=dict)

    def with_local(self, name: str, value: Tensor) -> Scope:
        """Return the same scope with one more local name."""
        return Scope(self.node, self.cls, {**self.local, name: value})


@dataclass(frozen=True, slots=True)
class Bound:
    """An expression with its scope; `indices` select an element (in an array of components)."""

    expr: Expr
    scope: Scope
    place: Place
    indices: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Mods:
    """A modifier whose expressions have their scope."""

    value: Bound | None = None
    inner: dict[str, Mods] = field(default_factory=dict)
    each: bool = False
    final: bool = False
    place: Place | None = None

    def element(self, indices: tuple[int, ...]) -> Mods:
        """Return the modifier of one element of an array of components."""
        if self.each:
            return self
        value = self.value and Bound(
            self.value.expr, self.value.scope, self.value.place, self.value.indices + indices
        )
        inner = {k: m.element(indices) for k, m in self.inner.items()}
        return Mods(value, inner, final=self.final, place=self.place)


def scoped(modifier: Modifier, scope: Scope, place: Place) -> Mods:
    """Attach a scope to a modifier."""
    at = modifier.place or place
    value = Bound(modifier.value, scope, at) if modifier.value is not None else None
    inner = {n: scoped(m, scope, at) for n, m in modifier.inner}
    return Mods(value, inner, modifier.each, modifier.final, modifier.place)


def merge(outer: Mods, inner: Mods) -> Mods:
    """Merge two modifiers; the outer one overrides the inner one, unless that is final."""
    if inner.final and (outer.value or outer.inner):
        raise ExportError(outer.place, "this is final and cannot be modified")
    names = {**inner.inner, **outer.inner}
    merged = {
        name: merge(outer.inner[name], inner.inner[name])
        if name in outer.inner and name in inner.inner
        else names[name]
        for name in names
    }
    final = outer.final or inner.final
    return Mods(outer.value or inner.value, merged, outer.each, final, outer.place or inner.place)


@dataclass(slots=True)
class Leaf:
    """A variable of a built-in type, possibly an array."""

    name: str
    type: Type
    dims: tuple[int, ...]
    component: Component
    variability: str
    mods: Mods
    public: bool
    causality: str
    description: str

    def scalars(self) -> list[str]:
        """Return the names of its elements in row-major order."""
        if not self.dims:
            return [self.name]
        ranges = [range(1, n + 1) for n in self.dims]
        return [f"{self.name}[{','.join(map(str, index))}]" for index in product(*ranges)]


@dataclass(slots=True)
class NodeArray:
    """An array of sub-models."""

    dims: tuple[int, ...]
    nodes: list[Node]


Child = "Leaf | Node | NodeArray"


class Evaluation(Protocol):
    """What evaluates expressions in a scope, for instances, calls and built-in functions; see Evaluator."""

    model: FlatModel
    events: bool
    sink: Sink | None
    leaves: dict[str, tuple[Leaf, int]]

    def at(self, scope: Scope, *, events: bool = False, sink: Sink | None = None) -> Evaluation:
        """Return what evaluates in another scope."""

    def without_events(self) -> AbstractContextManager[None]:
        """Evaluate relations without events within this context."""

    def bound(self, bound: Bound) -> Tensor:
        """Evaluate a modifier."""

    def scalar(self, expr: Expr) -> Scalar:
        """Evaluate an expression that must be scalar."""

    def value(self, expr: Expr) -> Tensor:
        """Evaluate any expression."""

    def static(self, value: Scalar, place: Place) -> Lit:
        """Compute a value that must be known before simulation."""

    def static_integer(self, expr: Expr, place: Place) -> int:
        """Compute a size or other integer that must be known before simulation."""

    def parametric(self, value: Scalar) -> bool:
        """Whether a value is known when the simulation starts."""


class Node:
    """An instance of a model."""

    def __init__(
        self,
        cls: Class,
        prefix: str,
        mods: Mods,
        evaluator: Evaluation,
        *,
        public: bool = True,
        place: Place | None = None,
    ) -> None:
        self.cls = cls
        self.prefix = prefix
        self.evaluator = evaluator
        self.public = public
        self.elements: dict[str, tuple[Component, Class, Mods]] = {}
        if cls.partial:
            raise ExportError(place or cls.place, f"'{cls.full_name}' is partial and cannot be instantiated")
        self.classes: list[Class] = []
        self._children: dict[str, Leaf | Node | NodeArray] = {}
        self._open: set[str] = set()
        self._collect(cls, mods)
        for name, mod in mods.inner.items():
            if name not in self.elements:
                raise ExportError(
                    mod.place or cls.place, f"'{cls.full_name}' has no component '{name}' to modify"
                )

    def _collect(self, cls: Class, mods: Mods) -> None:
        if cls.alias_of:
            raise ExportError(
                cls.place, f"the short definition of '{cls.name}' is only supported as the type of components"
            )
        if cls.kind not in ("model", "block", "class", "record", "package", "function"):
            raise ExportError(cls.place, f"'{cls.kind} {cls.name}' cannot be instantiated")
        for base, modifier in base_classes(cls):
            self._collect(base, merge(mods, scoped(modifier, Scope(self, cls), cls.place)))
        self.classes.append(cls)
        for component in cls.components:
            own = scoped(component.modifier, Scope(self, cls), component.place)
            outer = mods.inner.get(component.name, Mods())
            if component.final and component.name in mods.inner:
                raise ExportError(component.place, f"'{component.name}' is final and cannot be modified")
            if component.name in self.elements and self.elements[component.name][0] != component:
                raise ExportError(component.place, f"'{component.name}' is declared twice")
            self.elements[component.name] = (component, cls, merge(outer, own))

    def child(self, name: str) -> Leaf | Node | NodeArray:
        """Return the component of this name."""
        if name not in self._children:
            if name in self._open:
                raise ExportError(
                    self.elements[name][0].place, f"the declaration of '{name}' depends on itself"
                )
            self._open.add(name)
            self._children[name] = self._make(name)
        return self._children[name]

    def children(self) -> Iterator[Leaf | Node | NodeArray]:
        """Yield all components in the order of declaration."""
        for name in self.elements:
            yield self.child(name)

    def _make(self, name: str) -> Leaf | Node | NodeArray:
        component, declaring, mods = self.elements[name]
        type_name, dims_text = component.type_name, component.dimensions
        scope = Scope(self, declaring)
        if type_name not in BUILTIN_TYPES:
            cls = find_class(type_name, declaring, component.place)
            while cls.alias_of:
                alias = cls.alias_of
                mods = merge(mods, scoped(alias.modifier, Scope(None, cls), cls.place))
                dims_text = dims_text + cls.alias_dimensions
                type_name = alias.name
                if type_name in BUILTIN_TYPES:
                    break
                cls = find_class(type_name, cls.parent or cls, component.place)
            if cls.literals:
                type_name = cls.full_name
                self.evaluator.model.enumerations[type_name] = cls
        public = self.public and component.public
        if type_name in BUILTIN_TYPES or type_name in self.evaluator.model.enumerations:
            return self._leaf(
                component, type_name, self._dims(dims_text, mods, scope, component), mods, public=public
            )
        if component.causality or component.variability:
            raise ExportError(
                component.place, f"'{name}': a prefix before a component of a class is not supported"
            )
        dims = self._dims(dims_text, mods, scope, component)
        flat = self.prefix + name
        if not dims:
            return Node(cls, flat + ".", mods, self.evaluator, public=public, place=component.place)
        nodes = []
        for index in product(*(range(1, n + 1) for n in dims)):
            label = f"{flat}[{','.join(map(str, index))}]."
            nodes.append(
                Node(cls, label, mods.element(index), self.evaluator, public=public, place=component.place)
            )
        return NodeArray(dims, nodes)

    def _leaf(
        self, component: Component, type_name: str, dims: tuple[int, ...], mods: Mods, *, public: bool
    ) -> Leaf:
        if type_name == "String":
            raise ExportError(component.place, f"'{component.name}': String variables are not supported")
        for name, mod in mods.inner.items():
            if name not in ATTRIBUTES:
                raise ExportError(mod.place or component.place, f"'{type_name}' has no attribute '{name}'")
        top = self.prefix == ""
        leaf = Leaf(
            name=self.prefix + component.name,
            type=type_name,
            dims=dims,
            component=component,
            variability=component.variability,
            mods=mods,
            public=public,
            causality=component.causality if top else "",
            description=component.description,
        )
        self.evaluator.leaves.update({scalar: (leaf, k) for k, scalar in enumerate(leaf.scalars())})
        return leaf

    def _dims(
        self, texts: tuple[Expr, ...], mods: Mods, scope: Scope, component: Component
    ) -> tuple[int, ...]:
        if any(isinstance(text, Colon) for text in texts):
            if mods.value is None:
                raise ExportError(
                    component.place, f"'{component.name}' needs a value, which determines its size"
                )
            dims = self.evaluator.bound(mods.value).dims
            if len(dims) != len(texts):
                raise ExportError(
                    component.place, f"the value of '{component.name}' must have {len(texts)} dimensions"
                )
            return dims
        dims = tuple(self.evaluator.at(scope).static_integer(text, component.place) for text in texts)
        if any(n < 0 for n in dims) or prod(dims) > 1_000_000:
            raise ExportError(component.place, f"'{component.name}' cannot have the dimensions {dims}")
        return dims
