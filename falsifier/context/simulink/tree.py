"""What both formats have in common: named sections with values and sections within them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Node:
    """One section of a Simulink file, such as a block.

    Attributes:
        kind: what it is: ``Block``, ``Line``, ``state``, ...
        values: its parameters by name, as text.
        children: the sections within it, in order.
    """

    kind: str
    values: Mapping[str, str] = field(default_factory=dict)
    children: tuple["Node", ...] = ()

    def get(self, *names: str) -> str:
        """Return the first of these values that is present; empty if none is."""
        return next((self.values[name] for name in names if name in self.values), "")

    def all(self, kind: str) -> tuple["Node", ...]:
        """Return the sections of this kind directly within."""
        return tuple(child for child in self.children if child.kind == kind)

    def first(self, kind: str) -> "Node | None":
        """Return the first section of this kind directly within."""
        return next((child for child in self.children if child.kind == kind), None)

    def walk(self) -> Iterator["Node"]:
        """Return this section and all within it, outer ones first."""
        queue = [self]
        while queue:
            node = queue.pop()
            yield node
            queue.extend(reversed(node.children))
