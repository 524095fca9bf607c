"""A diagram in words: only its names, or its structure with the parameters that carry meaning."""

from collections.abc import Collection, Iterator, Mapping

from falsifier.context.simulink.diagram import Block, BlockPath, BlockSystem, Chart, Diagram, Wire
from falsifier.core.words import counted


def names_text(diagram: Diagram) -> str:
    """Return the names of a diagram: inports, outports, blocks by system, signals, states."""
    lines = [f"{'Library' if diagram.is_library else 'Model'} {diagram.name}"]
    for path, system in diagram.root.walk():
        lines += _names(path, system)
    for chart in diagram.charts:
        names = ", ".join(state.name for state in chart.states)
        lines.append(f"Chart {chart.name}: {names}" if names else f"MATLAB function {chart.name}")
    return "\n".join(lines)


def structure_text(diagram: Diagram, only: Collection[BlockPath] | None = None) -> str:
    """Return the structure of a diagram: what each block is, its parameters, and what leads to it.

    Only the blocks of these paths are told; None: all.
    """
    settings = "; ".join(f"{name} {value}" for name, value in diagram.settings)
    kind = "Library" if diagram.is_library else "Model"
    lines = [f"{kind} {diagram.name}{f' ({settings})' if settings else ''}"]
    for path, system in diagram.root.walk():
        if only is None or not path or path in only:
            lines += _structure(path, system, only)
    for chart in diagram.charts:
        if only is None or tuple(chart.name.split("/")) in only:
            lines += _chart(chart)
    return "\n".join(lines)


def _names(path: BlockPath, system: BlockSystem) -> Iterator[str]:
    where = f"{'/'.join(path)}: " if path else ""
    groups = {
        "inports": system.ports("Inport"),
        "outports": system.ports("Outport"),
        "blocks": tuple(b.name for b in system.blocks if b.type not in ("Inport", "Outport")),
        "signals": tuple(dict.fromkeys(wire.name for wire in system.wires if wire.name)),
    }
    for title, names in groups.items():
        if names:
            yield f"{where}{title} {', '.join(names)}"


def _structure(path: BlockPath, system: BlockSystem, only: Collection[BlockPath] | None) -> Iterator[str]:
    leading = system.leading()
    told = [b for b in system.blocks if only is None or (*path, b.name) in only]
    if path:
        yield f"Subsystem {'/'.join(path)}"
    order = {"Inport": 0, "Outport": 2}
    for block in sorted(told, key=lambda block: (order.get(block.type, 1), block.number)):
        yield f"- {_block(block)}{_from(leading.get(block.name, {}))}"
    left_out = len(system.blocks) - len(told)
    if left_out:
        yield f"  ({counted(left_out, 'block')} left out: in this file, nothing required depends on them)"


def _block(block: Block) -> str:
    kind = "chart" if block.is_chart else block.type
    number = f" {block.number}" if block.number else ""
    stated = ", ".join(f"{name} = {value}" for name, value in block.parameters)
    reference = f", stands for {block.reference} (not followed)" if block.reference else ""
    off = ", commented out" if block.is_off else ""
    return f"{block.name}: {kind}{number}{f' ({stated})' if stated else ''}{reference}{off}"


def _from(leading: Mapping[str, Wire]) -> str:
    # Ports in order; named ones, such as enable, last.
    ports = sorted(leading, key=lambda port: (not port.isdigit(), port.rjust(4)))
    return f" <- {', '.join(_source(port, leading[port]) for port in ports)}" if ports else ""


def _source(port: str, wire: Wire) -> str:
    source = wire.source
    output = "" if source.port == "1" else f":{source.port}"
    signal = f" '{wire.name}'" if wire.name and wire.name != source.block else ""
    role = "" if port.isdigit() else f"{port}: "
    return f"{role}{source.block}{output}{signal}"


def _chart(chart: Chart) -> Iterator[str]:
    sample = f", sample time {chart.sample_time}" if chart.sample_time else ""
    yield f"{'MATLAB function' if chart.script else 'Chart'} {chart.name}{sample}"
    scopes = dict.fromkeys(data.scope for data in chart.data)
    for scope in scopes:
        named = (
            f"{data.name}{f' = {data.initial}' if data.initial else ''}"
            for data in chart.data
            if data.scope == scope
        )
        yield f"- {scope}: {', '.join(named)}"
    for state in chart.states:
        parallel = " (parallel)" if state.is_parallel else ""
        actions = f": {' '.join(state.actions.splitlines())}" if state.actions else ""
        yield f"- state {state.name}{parallel}{actions}"
    for transition in chart.transitions:
        label = f" {transition.label}" if transition.label else ""
        yield f"- {transition.source or 'start'} -> {transition.target}{label}"
    yield from (f"  {line}" for line in chart.script.splitlines())
