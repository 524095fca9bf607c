"""Arrays of scalar expressions: construction, conversion and element access."""

from __future__ import annotations

from itertools import product
from math import prod

from ..read.syntax import Component, ExportError, Place
from .ir import Lit, Op, Scalar, Tensor, Type, alike


def scalar_tensor(item: Scalar) -> Tensor:
    """A tensor without dimensions."""
    return Tensor((), (item,), item.type)


def tensor(dims: tuple[int, ...], items: list[Scalar], kind: Type | None = None) -> Tensor:
    """A tensor of the given type, or of the common type of its items."""
    types = {item.type for item in items}
    found: Type = "Real" if not types or "Real" in types else types.pop()
    return Tensor(dims, tuple(items), kind or found)


def type_of(component: Component) -> Type:
    """Return the built-in type of a component of a function or package."""
    if component.type_name not in ("Real", "Integer", "Boolean"):
        raise ExportError(
            component.place, f"type '{component.type_name}' is not supported in functions and packages"
        )
    return component.type_name


def cast(item: Scalar, kind: Type, place: Place) -> Scalar:
    """Convert an Integer to Real if necessary; any other type must match."""
    if item.type == kind:
        return item
    if kind == "Real" and item.type == "Integer":
        return Lit(float(item.value), "Real") if isinstance(item, Lit) else Op("real", (item,), "Real")
    raise ExportError(place, f"expected {kind}, found {item.type}")


def fitted(value: Tensor, dims: tuple[int, ...], kind: Type, place: Place) -> Tensor:
    """Convert a value for a variable of this size and type; a scalar fills an array."""
    items = value.items
    if value.dims != dims:
        if value.dims:
            raise ExportError(place, f"expected size {list(dims)}, found {list(value.dims)}")
        items = value.items * prod(dims)
    return Tensor(dims, tuple(cast(item, kind, place) for item in items), kind)


def stacked(parts: list[Tensor], place: Place) -> Tensor:
    """An array of arrays."""
    if not parts:
        raise ExportError(place, "an empty array literal has no type; use zeros(0)")
    if any(part.dims != parts[0].dims for part in parts):
        raise ExportError(place, "the rows of the array have different sizes")
    if any(not alike(part.type, parts[0].type) for part in parts):
        raise ExportError(place, "the elements of the array have different types")
    return tensor((len(parts), *parts[0].dims), [item for part in parts for item in part.items])


def selected(value: Tensor, chosen: list[Tensor], place: Place) -> Tensor:
    """Return the part of an array selected by known subscripts, one scalar or vector per dimension."""
    rest = value.dims[len(chosen) :]
    block = prod(rest)
    strides = [prod(value.dims[k + 1 : len(chosen)]) for k in range(len(chosen))]
    items: list[Scalar] = []
    for combination in product(*(index.items for index in chosen)):
        offset = 0
        for item, stride, size in zip(combination, strides, value.dims, strict=False):
            number = int(item.value) if isinstance(item, Lit) else 0
            if not 1 <= number <= size:
                raise ExportError(place, f"subscript {number} is outside 1..{size}")
            offset += (number - 1) * stride
        items.extend(value.items[offset * block : (offset + 1) * block])
    dims = tuple(index.dims[0] for index in chosen if index.dims) + rest
    return Tensor(dims, tuple(items), value.type)


def element(value: Tensor, indices: tuple[int, ...], place: Place) -> Tensor:
    """Return one element or sub-array."""
    return selected(value, [scalar_tensor(Lit(k, "Integer")) for k in indices], place)
