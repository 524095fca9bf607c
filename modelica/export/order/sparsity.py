"""Which derivatives depend on which states, for the implicit method."""

from __future__ import annotations

from ..flat.ir import Time, walk
from .contents import values
from .layout import System
from .sort import Block


def dependences(system: System) -> list[set[int]]:
    """Return, per derivative, the indices of the states that it depends on between events."""
    known = {name: {k} for k, name in enumerate(system.states)}
    for block in system.blocks:
        found = set() if block.discrete else {k for name in block.uses for k in known.get(name, ())}
        known |= dict.fromkeys(block.defines, found)
    return [known[f"der({name})"] for name in system.states]


def groups(rows: list[set[int]]) -> list[int]:
    """Return a group per state, so that no derivative depends on two states of one group."""
    conflicts = [set().union(*(row for row in rows if k in row)) for k in range(len(rows))]
    chosen: list[int] = []
    for k in range(len(rows)):
        taken = {chosen[other] for other in conflicts[k] if other < k}
        chosen.append(next(g for g in range(len(rows)) if g not in taken))
    return chosen


def depend_on_time(blocks: list[Block]) -> bool:
    """Whether any of the blocks depends on time."""
    return any(isinstance(part, Time) for b in blocks for value in values(b.item) for part in walk(value))
