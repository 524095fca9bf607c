"""Formulas under other names."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from falsifier.stl.expression import Name

T = TypeVar("T")


def renamed(node: T, names: Mapping[str, str]) -> T:
    """Return the same formula or expression with other names; names that are not listed stay."""
    return _renamed(node, names)  # type: ignore[no-any-return]


def _renamed(node: Any, names: Mapping[str, str]) -> Any:
    if isinstance(node, Name):
        return Name(names.get(node.name, node.name))
    if isinstance(node, tuple):
        return tuple(_renamed(part, names) for part in node)
    if is_dataclass(node) and not isinstance(node, type):
        return type(node)(*(_renamed(getattr(node, f.name), names) for f in fields(node)))
    return node
