"""Which blocks influence some signals: backwards along the lines, through subsystems and tags."""

from collections.abc import Iterable, Iterator, Mapping

from falsifier.context.simulink.diagram import Block, BlockSystem, Diagram

# What decides whether a system is computed at all.
_CONTROLS = ("EnablePort", "TriggerPort", "ActionPort", "ForIterator", "WhileIterator", "ResetPort")
# A block by its path: the names of the systems around it and its own.
Place = tuple[str, ...]


def upstream(diagram: Diagram, signals: Iterable[str]) -> frozenset[Place] | None:
    """Return the blocks on which signals depend, with the systems around them.

    A signal is an outport or block of its name, or where a line of its name begins. The rule follows a block
    to all blocks that lead to it; a subsystem's output to what is within it, its inports to what leads to the
    subsystem, every block to what enables or triggers its system, and a From block to the Goto blocks of its
    tag anywhere in the model.

    Args:
        diagram: the model.
        signals: names as the requirement has them; ``controller.u`` also names ``u``.

    Returns:
        Paths of blocks; None if no signal was found, so that nothing can be left out.
    """
    sources = _sources(diagram)
    wanted = {name.rpartition(".")[2].strip("'") for name in signals} | set(signals)
    queue = [place for place in sources if place[-1] in wanted and place[0]]
    queue += [place for name, place in _named_wires(diagram.root) if name in wanted]
    if not queue:
        return None
    found: set[Place] = set()
    while queue:
        place = queue.pop()
        if place not in found:
            found.add(place)
            queue += sources.get(place, ())
    found = {place for place in found if place[0]}
    around = {place[:depth] for place in found for depth in range(1, len(place))}
    return frozenset(found | around)


def _sources(diagram: Diagram) -> Mapping[Place, list[Place]]:
    """The blocks that lead directly to each block; tags stand among them, as places of no system."""
    sources: dict[Place, list[Place]] = {}
    for path, system in diagram.root.walk():
        controls = [(*path, block.name) for block in system.blocks if path and block.type in _CONTROLS]
        for block in system.blocks:
            place = (*path, block.name)
            found = sources.setdefault(place, [])
            found += [each for each in controls if each != place]
            if block.type in ("Goto", "DataStoreWrite"):
                sources.setdefault(_tag(block), []).append(place)
            if block.type in ("From", "DataStoreRead"):
                found.append(_tag(block))
            if block.type in ("Inport", *_CONTROLS) and path:
                found.append(path)
            if block.system is not None and not block.is_off:
                found += [(*place, name) for name in block.system.ports("Outport")]
        for wire in system.wires:
            if wire.source is not None:
                for target in wire.targets:
                    sources.setdefault((*path, target.block), []).append((*path, wire.source.block))
    for chart in diagram.charts:
        for data in chart.data:
            if data.scope == "data_store_memory":
                sources.setdefault(("", data.name), []).append(tuple(chart.name.split("/")))
    return sources


def _tag(block: Block) -> Place:
    return ("", block.parameter("GotoTag") or block.parameter("DataStoreName"))


def _named_wires(root: BlockSystem) -> Iterator[tuple[str, Place]]:
    for path, system in root.walk():
        for wire in system.wires:
            if wire.name and wire.source is not None:
                yield wire.name, (*path, wire.source.block)
