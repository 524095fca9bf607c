"""Which blocks influence some signals: backwards along the lines, through subsystems and tags."""

from collections.abc import Iterable, Iterator, Mapping

from falsifier.context.simulink.diagram import BlockSystem, Diagram

# A block by its path: the names of the systems around it and its own.
Place = tuple[str, ...]


def upstream(diagram: Diagram, signals: Iterable[str]) -> frozenset[Place] | None:
    """Return the blocks on which signals depend, with the systems around them.

    A signal is an outport or block of its name, or where a line of its name begins. The rule follows a block
    to all blocks that lead to it; a subsystem's output to what is within it, its inports to what leads to the
    subsystem, and a From block to the Goto blocks of its tag anywhere in the model.

    Args:
        diagram: the model.
        signals: names as the requirement has them; ``controller.u`` also names ``u``.

    Returns:
        Paths of blocks; None if no signal was found, so that nothing can be left out.
    """
    sources = _sources(diagram.root)
    wanted = {name.rpartition(".")[2].strip("'") for name in signals} | set(signals)
    queue = [place for place in sources if place[-1] in wanted]
    queue += [place for name, place in _named_wires(diagram.root) if name in wanted]
    if not queue:
        return None
    found: set[Place] = set()
    while queue:
        place = queue.pop()
        if place not in found:
            found.add(place)
            queue += sources.get(place, ())
    around = {place[:depth] for place in found for depth in range(1, len(place))}
    return frozenset(found | around)


def _sources(root: BlockSystem) -> Mapping[Place, list[Place]]:
    """The blocks that lead directly to each block."""
    sources: dict[Place, list[Place]] = {}
    tags: dict[str, list[Place]] = {}
    for path, system in root.walk():
        for block in system.blocks:
            sources.setdefault((*path, block.name), [])
            if block.type in ("Goto", "DataStoreWrite"):
                tags.setdefault(_tag(block.parameters), []).append((*path, block.name))
    for path, system in root.walk():
        for wire in system.wires:
            if wire.source is not None:
                for target in wire.targets:
                    sources[*path, target.block].append((*path, wire.source.block))
        for block in system.blocks:
            place = (*path, block.name)
            if block.type in ("From", "DataStoreRead"):
                sources[place] += tags.get(_tag(block.parameters), [])
            if block.type in ("Inport", "EnablePort", "TriggerPort") and path:
                sources[place].append(path)
            if block.system is not None and not block.is_off:
                sources[place] += [(*place, name) for name in block.system.ports("Outport")]
    return sources


def _tag(parameters: Iterable[tuple[str, str]]) -> str:
    return next((value for name, value in parameters if name in ("GotoTag", "DataStoreName")), "")


def _named_wires(root: BlockSystem) -> Iterator[tuple[str, Place]]:
    for path, system in root.walk():
        for wire in system.wires:
            if wire.name and wire.source is not None:
                yield wire.name, (*path, wire.source.block)
