"""Block diagrams and state charts as values, and which blocks influence some signals."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

# What decides whether a system is computed at all.
_CONTROLS = ("EnablePort", "TriggerPort", "ActionPort", "ForIterator", "WhileIterator", "ResetPort")
# A block by its path: the names of the systems around it and its own.
BlockPath = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Block:
    """One block."""

    type: str  # such as Gain
    name: str  # within its system, in one line
    parameters: tuple[tuple[str, str], ...] = ()  # those that carry meaning, with their values
    reference: str = ""  # the library block or model that it stands for, which is not followed
    number: int = 0  # of an inport or outport, its position from 1
    system: "BlockSystem | None" = None  # within a subsystem; None for charts, which are told apart
    is_chart: bool = False  # whether a state chart or a MATLAB function is within
    inputs: tuple[str, ...] = ()  # of a chart, their names
    is_off: bool = False  # whether it is commented out

    def parameter(self, name: str) -> str:
        """Return the value of a parameter; empty if it is not stated."""
        return dict(self.parameters).get(name, "")


@dataclass(frozen=True, slots=True)
class End:
    """One end of a line."""

    block: str
    port: str  # its number, or enable, trigger, state, ...


@dataclass(frozen=True, slots=True)
class Wire:
    """A line from one output to any number of inputs."""

    source: End
    targets: tuple[End, ...]
    name: str = ""


@dataclass(frozen=True, slots=True)
class BlockSystem:
    """Blocks in the order of the file, and the lines between them."""

    blocks: tuple[Block, ...] = ()
    wires: tuple[Wire, ...] = ()

    def ports(self, kind: Literal["Inport", "Outport"]) -> tuple[str, ...]:
        """Return the names of the inports or outports, in the order of their numbers."""
        found = [b for b in self.blocks if b.type == kind and not b.is_off]
        return tuple(b.name for b in sorted(found, key=lambda b: b.number))

    def leading(self) -> Mapping[str, Mapping[str, Wire]]:
        """Return the line that leads to each port of each block."""
        found: dict[str, dict[str, Wire]] = {}
        for wire in self.wires:
            for target in wire.targets:
                found.setdefault(target.block, {})[target.port] = wire
        return found

    def walk(self, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], "BlockSystem"]]:
        """Return this system and all within it with their paths, outer ones first."""
        yield path, self
        for block in self.blocks:
            if block.system is not None and not block.is_off:
                yield from block.system.walk((*path, block.name))


@dataclass(frozen=True, slots=True)
class State:
    """One state, function or box of a chart."""

    name: str  # with those of the states around it: On.Slow
    actions: str = ""  # what it does on entry, during and on exit; of a function, its body
    is_parallel: bool = False  # whether it is active beside its neighbours


@dataclass(frozen=True, slots=True)
class Transition:
    """One transition of a chart, from a state or junction to another."""

    source: str  # empty for a default transition
    target: str
    label: str = ""  # event, condition and actions, as written


@dataclass(frozen=True, slots=True)
class ChartData:
    """One variable of a chart."""

    name: str
    scope: str  # input, output, local, parameter, constant, ...
    initial: str = ""


@dataclass(frozen=True, slots=True)
class Chart:
    """A state chart or MATLAB function."""

    name: str  # path of its block
    states: tuple[State, ...] = ()  # outer ones first
    transitions: tuple[Transition, ...] = ()
    data: tuple[ChartData, ...] = ()
    script: str = ""  # the code of a MATLAB function; empty for a chart
    sample_time: str = ""  # empty if it is inherited


@dataclass(frozen=True, slots=True)
class Diagram:
    """A model or library."""

    name: str  # empty if the file does not state it
    root: BlockSystem  # the outermost system
    charts: tuple[Chart, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()  # solver, step and stop time, as far as they are stated
    is_library: bool = False


def upstream(diagram: Diagram, signals: Iterable[str]) -> frozenset[BlockPath] | None:
    """Return the blocks on which signals depend, with the systems around them.

    A signal is an outport or block of its name, or where a line of its name begins. The rule follows a block
    to all blocks that lead to it; a subsystem's output to what is within it, its inports to what leads to the
    subsystem, every block to what enables or triggers its system, and a From block to the Goto blocks of its
    tag anywhere in the model.

    Of the requirement's names, ``controller.u`` also names ``u``. None is returned if no signal was found, or
    only inports of the whole, whatever passes them on under their names: they may depend on all of it
    outside, so that nothing can be left out.
    """
    sources = _sources(diagram)
    wanted = {name.rpartition(".")[2].strip("'") for name in signals} | set(signals)
    queue = [place for place in sources if place[-1] in wanted and place[0]]
    for path, system in diagram.root.walk():
        queue += [(*path, wire.source.block) for wire in system.wires if wire.name and wire.name in wanted]
    if all(place[-1] in diagram.root.ports("Inport") for place in queue):
        return None
    found: set[BlockPath] = set()
    while queue:
        place = queue.pop()
        if place not in found:
            found.add(place)
            queue += sources.get(place, ())
    found = {place for place in found if place[0]}
    return frozenset(found | {place[:depth] for place in found for depth in range(1, len(place))})


def _sources(diagram: Diagram) -> Mapping[BlockPath, list[BlockPath]]:
    """The blocks that lead directly to each block; tags stand among them, as places of no system."""
    sources: dict[BlockPath, list[BlockPath]] = {}
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
        for name, wires in system.leading().items():
            found = sources.setdefault((*path, name), [])
            found += [(*path, wire.source.block) for wire in wires.values()]
    for chart in diagram.charts:
        for data in chart.data:
            if data.scope == "data_store_memory":
                sources.setdefault(("", data.name), []).append(tuple(chart.name.split("/")))
    return sources


def _tag(block: Block) -> BlockPath:
    return ("", block.parameter("GotoTag") or block.parameter("DataStoreName"))
