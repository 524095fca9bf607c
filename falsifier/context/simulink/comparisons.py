"""Comparisons with constants in block diagrams and state charts."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

from falsifier.context.simulink.diagram import Block, BlockPath, BlockSystem, Chart, Diagram
from falsifier.context.thresholds import Threshold, thresholds

# What blocks compare, by type: words are their parameters, u or u1 is what leads to the first port.
_COMPARING: Mapping[str, str] = {
    "Fcn": "Expr",
    "If": "IfExpression, ElseIfExpressions",
    "Reference": "u1 relop const",  # Compare To Constant
    "RelationalOperator": "u1 Operator u2",
    "Relay": "u1 >= OnSwitchValue, u1 <= OffSwitchValue",
    "Saturate": "u1 < UpperLimit, u1 > LowerLimit",
    "Saturation": "u1 < UpperLimit, u1 > LowerLimit",
    "Switch": "Criteria",
}
_WORD = re.compile(r"\b[A-Za-z]\w*+")
_PORT = re.compile(r"\bu(\d*+)\b(?!\()")
_LONGEST = 160  # characters of a threshold
_NUMBER = re.compile(r"[-+]?(\d++\.?\d*+|\.\d++)([eE][-+]?\d++)?$")
# A constant may state its type: single(5), int8(3).
_CAST = re.compile(r"(?:u?int(?:8|16|32|64)|single|double|boolean)\s*\(([^()]*)\)$")


def diagram_thresholds(diagram: Diagram, only: Collection[BlockPath] | None = None) -> Iterator[Threshold]:
    """Return the comparisons with constants in blocks of these paths; None: in all."""
    fed: dict[BlockPath, Mapping[str, str]] = {}  # what leads to the inports of each subsystem and chart
    ports = {*diagram.root.ports("Inport"), *diagram.root.ports("Outport")}
    for path, system in diagram.root.walk():
        leading = _sources(system, fed.get(path, {}))
        inner = {_quoted(b.name) for b in system.blocks if b.type not in ("Inport", "Outport")}
        for block in system.blocks:
            place = (*path, block.name)
            inputs = leading.get(block.name, {})
            inports = block.system.ports("Inport") if block.system is not None else block.inputs
            # A block that only has a name of its own is left out: the inport's says more, unless it is the
            # name of another signal, one of the model's ports.
            fed[place] = {
                name: inputs[str(i)]
                for i, name in enumerate(inports, start=1)
                if str(i) in inputs and (inputs[str(i)] not in inner or name in ports)
            }
            if block.is_off or (only is not None and place not in only):
                continue
            yield from thresholds(_compared(block, inputs), {}, f"{diagram.name}/{'/'.join(place)}")
    for chart in diagram.charts:
        place = tuple(chart.name.split("/"))
        if only is None or place in only:
            yield from _chart_thresholds(chart, fed.get(place, {}), f"{diagram.name}/{chart.name}")


def _chart_thresholds(chart: Chart, fed: Mapping[str, str], shown: str) -> Iterator[Threshold]:
    """Return the comparisons of a chart; its variables stand for what leads to it, or for nothing outside."""
    constants = {d.name: d.initial for d in chart.data if d.initial and d.scope in ("constant", "parameter")}
    own = {d.name: "" for d in chart.data if d.scope in ("local", "temporary")}
    inputs = {d.name for d in chart.data if d.scope == "input"}
    outside = own | {name: text for name, text in fed.items() if name in inputs and text != name}
    for text in (*(t.label for t in chart.transitions), *(s.actions for s in chart.states), chart.script):
        for found in thresholds(text, constants, shown):
            inner = found.names & outside.keys()
            names = {outside[name] for name in inner if outside[name].isidentifier()}
            told = ", ".join(f"{name} = {outside[name]}" for name in sorted(inner) if outside[name])
            shown_with = f"{found.text} ({told})" if told else found.text
            yield replace(found, names=(found.names - inner) | names, text=shown_with)


def _sources(system: BlockSystem, fed: Mapping[str, str]) -> Mapping[str, Mapping[str, str]]:
    """For each block, what leads to each input: a constant's value, or the name of a signal or block.

    Inports stand for what is ``fed`` to them from outside.
    """
    values = {b.name: _uncast(b.parameter("Value")) for b in system.blocks if b.type == "Constant"}
    inports, outports = set(system.ports("Inport")), set(system.ports("Outport"))
    found: dict[str, dict[str, str]] = {}
    for wire in system.wires:
        source = wire.source.block
        outport = next((end.block for end in wire.targets if end.block in outports), "")
        own = source if source in inports else ""  # before the name of its line
        name = values.get(source) or fed.get(source) or own or wire.name or outport or source
        for target in wire.targets:
            found.setdefault(target.block, {})[target.port] = _quoted(name)
    return found


def _uncast(value: str) -> str:
    found = _CAST.match(value.strip())
    return found[1].strip() if found else value


def _quoted(name: str) -> str:
    """Write a name of several words in quotes, so that it stays one name; numbers stay as they are."""
    if name.isidentifier() or _NUMBER.match(name) or name.startswith("'"):
        return name
    return "'" + name.replace("'", " ").replace("\\", "/") + "'"


def _compared(block: Block, inputs: Mapping[str, str]) -> str:
    """Return what a block compares, separated by commas; empty if it compares nothing."""
    stated = {"Threshold": "0", **dict(block.parameters)}
    text = _WORD.sub(lambda word: stated.get(word[0], word[0]), _COMPARING.get(block.type, ""))
    if block.type == "Switch" and len(stated["Threshold"]) <= _LONGEST:  # its criteria name it
        text = text.replace("Threshold", stated["Threshold"])
    return _PORT.sub(lambda port: inputs.get(port[1] or "1", port[0]), text).replace("~=", "!=")
