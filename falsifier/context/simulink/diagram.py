"""Block diagrams and state charts as values."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Block:
    """One block.

    Attributes:
        type: its type, such as ``Gain``.
        name: its name within its system, in one line.
        parameters: names and values of the parameters that carry meaning, as text.
        reference: the library block or model that it stands for; empty if none. It is not followed.
        number: of an inport or outport, its position from 1; otherwise 0.
        system: what is within a subsystem; None if nothing is, and for charts, which are told apart.
        is_chart: whether a state chart or a MATLAB function is within.
        is_off: whether it is commented out.
    """

    type: str
    name: str
    parameters: tuple[tuple[str, str], ...] = ()
    reference: str = ""
    number: int = 0
    system: "BlockSystem | None" = None
    is_chart: bool = False
    is_off: bool = False

    def parameter(self, name: str) -> str:
        """Return the value of a parameter; empty if it is not stated."""
        return dict(self.parameters).get(name, "")


@dataclass(frozen=True, slots=True)
class End:
    """One end of a line.

    Attributes:
        block: name of the block.
        port: number of the port, or ``enable``, ``trigger``, ``state``, ...
    """

    block: str
    port: str


@dataclass(frozen=True, slots=True)
class Wire:
    """A line from one output to any number of inputs.

    Attributes:
        source: where it begins; None if it is not connected.
        targets: where it ends.
        name: name of the signal; empty if it has none.
    """

    source: End | None
    targets: tuple[End, ...]
    name: str = ""


@dataclass(frozen=True, slots=True)
class BlockSystem:
    """Blocks and the lines between them.

    Attributes:
        blocks: the blocks, in the order of the file.
        wires: the lines.
    """

    blocks: tuple[Block, ...] = ()
    wires: tuple[Wire, ...] = ()

    def ports(self, kind: Literal["Inport", "Outport"]) -> tuple[str, ...]:
        """Return the names of the inports or outports, in the order of their numbers."""
        found = [b for b in self.blocks if b.type == kind and not b.is_off]
        return tuple(b.name for b in sorted(found, key=lambda b: b.number))

    def walk(self, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], "BlockSystem"]]:
        """Return this system and all within it with their paths, outer ones first."""
        yield path, self
        for block in self.blocks:
            if block.system is not None and not block.is_off:
                yield from block.system.walk((*path, block.name))


@dataclass(frozen=True, slots=True)
class State:
    """One state, function or box of a chart.

    Attributes:
        name: its name, with those of the states around it: ``On.Slow``.
        actions: what it does on entry, during and on exit; of a function, its body.
        is_parallel: whether it is active beside its neighbours.
    """

    name: str
    actions: str = ""
    is_parallel: bool = False


@dataclass(frozen=True, slots=True)
class Transition:
    """One transition of a chart.

    Attributes:
        source: the state or junction where it begins; empty for a default transition.
        target: where it ends.
        label: event, condition and actions, as written.
    """

    source: str
    target: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class ChartData:
    """One variable of a chart.

    Attributes:
        name: its name.
        scope: ``input``, ``output``, ``local``, ``parameter``, ``constant``, ...
        initial: its initial value; empty if it is not stated.
    """

    name: str
    scope: str
    initial: str = ""


@dataclass(frozen=True, slots=True)
class Chart:
    """A state chart or MATLAB function.

    Attributes:
        name: path of its block.
        states: its states, outer ones first.
        transitions: its transitions.
        data: its variables.
        script: the code of a MATLAB function; empty for a chart.
        sample_time: its sample time; empty if it is inherited.
    """

    name: str
    states: tuple[State, ...] = ()
    transitions: tuple[Transition, ...] = ()
    data: tuple[ChartData, ...] = ()
    script: str = ""
    sample_time: str = ""


@dataclass(frozen=True, slots=True)
class Diagram:
    """A model or library.

    Attributes:
        name: its name; empty if the file does not state it.
        root: the outermost system.
        charts: state charts and MATLAB functions.
        settings: solver, step and stop time, as far as they are stated.
        is_library: whether it is a library.
    """

    name: str
    root: BlockSystem
    charts: tuple[Chart, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()
    is_library: bool = False
