"""The order in which the components of a system step, from the dependencies that their FMUs declare.

An output depends *directly* on an input if a change of the input changes it at once. A component whose
outputs depend directly on an input must step after the component that feeds this input; otherwise its outputs
are late by one communication step.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from falsifier.fmu.network import SYSTEM, Link, Member, Place
from falsifier.fmu.structure import Structure


class Dependencies:
    """What the components declare of their outputs and inputs.

    Args:
        members: the components.
        structures: what their FMUs declare.
    """

    def __init__(self, members: Sequence[Member], structures: Sequence[Structure]) -> None:
        self._members, self._structures = members, structures

    def is_declared(self, place: Place, output: str) -> bool:
        """Whether the component declares that its output depends directly on the input at this place."""
        declared = self._inputs_of(place.member, output)
        return declared is not None and self._declared(place.member, place.name) in declared

    def is_possible(self, place: Place, output: str) -> bool:
        """Whether the output may depend directly on the input: declared, or nothing is declared."""
        return self._inputs_of(place.member, output) is None or self.is_declared(place, output)

    def outputs(self, member: int) -> list[str]:
        """Return the names of the outputs of a component."""
        return [v.name for v in self._members[member].description.info.outputs]

    def _inputs_of(self, member: int, output: str) -> frozenset[str] | None:
        return self._structures[member].inputs_of.get(self._declared(member, output))

    def _declared(self, member: int, name: str) -> str:
        return self._members[member].description.slots[name].declared or name


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
    declared = _predecessors(members, links, dependencies, dependencies.is_declared)
    possible = _predecessors(members, links, dependencies, dependencies.is_possible)
    left, order = set(range(members)), []
    while left:
        first = min(left, key=lambda m: (len(declared[m] & left), len(possible[m] & left), m))
        left.remove(first)
        order.append(first)
    return tuple(order)


def late_links(links: Iterable[Link], order: Sequence[int]) -> Iterator[Link]:
    """Yield the connections whose target steps before their source."""
    position = {member: k for k, member in enumerate(order)}
    inner = (n for n in links if n.source.member != SYSTEM)
    return (n for n in inner if position[n.target.member] <= position[n.source.member])


def _predecessors(
    members: int,
    links: Iterable[Link],
    dependencies: Dependencies,
    is_direct: Callable[[Place, str], bool],
) -> list[set[int]]:
    found: list[set[int]] = [set() for _ in range(members)]
    for link in links:
        target = link.target
        outputs = dependencies.outputs(target.member)
        if link.source.member != target.member and any(is_direct(target, name) for name in outputs):
            found[target.member].add(link.source.member)
    return found
