"""The order in which the components of a system step, from the dependencies that their FMUs declare.

An output depends *directly* on an input if a change of the input changes it at once. A component whose
outputs depend directly on an input must step after the component that feeds this input; otherwise its outputs
are late by one communication step.
"""

from collections.abc import Iterable, Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from falsifier.fmu.description.structure import Structure
from falsifier.fmu.process.network import SYSTEM, Link, Member, Place


class Dependencies:
    """What the FMUs of the components declare of their outputs and inputs."""

    def __init__(self, members: Sequence[Member], structures: Sequence[Structure]) -> None:
        self._members = members
        # The inputs, as the FMU names them, on which each output depends directly; None: it does not say.
        self._inputs_of = [
            {v.name: structure.inputs_of.get(_declared(m, v.name)) for v in m.description.info.outputs}
            for m, structure in zip(members, structures, strict=True)
        ]

    def is_declared(self, place: Place, output: str) -> bool:
        """Whether the component declares that its output depends directly on the input at this place."""
        inputs = self._inputs_of[place.member][output] or ()
        return _declared(self._members[place.member], place.name) in inputs

    def may_reach(self, place: Place, *, undeclared: bool) -> bool:
        """Whether an output depends directly on the input at this place; or may, as nothing is declared."""
        outputs = self._inputs_of[place.member].items()
        return any(
            self.is_declared(place, name) or (undeclared and inputs is None) for name, inputs in outputs
        )


def _declared(member: Member, name: str) -> str:
    return member.description.slots[name].declared or name


def direct_loop(links: Sequence[Link], dependencies: Dependencies) -> list[Place]:
    """Return the inputs and outputs of a loop of declared direct dependencies; empty if there is none."""
    by_member: dict[int, list[int]] = {}
    for k, link in enumerate(links):
        by_member.setdefault(link.source.member, []).append(k)
    after = {
        k: [
            n
            for n in by_member.get(link.target.member, ())
            if dependencies.is_declared(link.target, links[n].source.name)
        ]
        for k, link in enumerate(links)
    }
    try:
        TopologicalSorter(after).prepare()
    except CycleError as error:
        # To the sorter, what comes after a link comes before it: in reverse, the cycle follows the signals.
        # Its first element is repeated at the end.
        cycle: list[int] = error.args[1][:0:-1]
        return [place for k in cycle for place in (links[k].source, links[k].target)]
    return []


def step_order(members: int, links: Iterable[Link], dependencies: Dependencies) -> tuple[int, ...]:
    """Return the positions of the components in the order in which they step.

    A component comes after those on whose outputs its own outputs depend directly: as declared, and if
    possible also where nothing is declared. Otherwise the order is the given one.
    """
    declared = _predecessors(members, links, dependencies, undeclared=False)
    possible = _predecessors(members, links, dependencies, undeclared=True)
    left, order = set(range(members)), []
    while left:
        first = min(left, key=lambda m: (len(declared[m] & left), len(possible[m] & left), m))
        left.remove(first)
        order.append(first)
    return tuple(order)


def iterated_order(
    members: int, links: Sequence[Link], dependencies: Dependencies
) -> tuple[tuple[int, ...], tuple[tuple[int, int], ...]]:
    """Return the order of stepping if loops are iterated, and the ranges of positions that iterate together.

    An FMU that declares nothing may depend directly on all its inputs, and counts as such.
    """
    before = _predecessors(members, links, dependencies, undeclared=True)
    for link in links:
        member = link.source.member
        if member == link.target.member and dependencies.may_reach(link.target, undeclared=True):
            before[member].add(member)
    reached = [_reached(m, before) for m in range(members)]
    base = {m: k for k, m in enumerate(step_order(members, links, dependencies))}
    groups = {m: sorted({m} | {n for n in reached[m] if m in reached[n]}, key=base.__getitem__) for m in base}
    left, order, loops = set(base), list[int](), list[tuple[int, int]]()
    while left:
        ready = [m for m in left if not (reached[m] & left) - set(groups[m])]
        group = groups[min(ready, key=base.__getitem__)]
        if group[0] in reached[group[0]]:
            loops.append((len(order), len(order) + len(group)))
        order += group
        left -= set(group)
    return tuple(order), tuple(loops)


def _reached(start: int, before: Sequence[set[int]]) -> set[int]:
    found, left = set[int](), [start]
    while left:
        new = before[left.pop()] - found
        found |= new
        left += new
    return found


def late_links(
    links: Iterable[Link], order: Sequence[int], loops: Sequence[tuple[int, int]]
) -> Iterator[Link]:
    """Yield the connections of components whose target steps before their source, unless both iterate."""
    position = {member: k for k, member in enumerate(order)}
    for link in links:
        ends = position[link.source.member], position[link.target.member]
        if ends[1] <= ends[0] and not any(first <= min(ends) and max(ends) < last for first, last in loops):
            yield link


def _predecessors(
    members: int, links: Iterable[Link], dependencies: Dependencies, *, undeclared: bool
) -> list[set[int]]:
    """Return the components that must step before each component."""
    found: list[set[int]] = [set() for _ in range(members)]
    for link in links:
        source, target = link.source.member, link.target
        if source not in (target.member, SYSTEM) and dependencies.may_reach(target, undeclared=undeclared):
            found[target.member].add(source)
    return found
