"""Comparisons in a block diagram: in the labels of charts, and in blocks that compare a signal."""

import re
from collections.abc import Collection, Iterator, Mapping

from falsifier.context.simulink.diagram import Block, BlockSystem, Diagram
from falsifier.context.simulink.upstream import Place

# Of an If block, u1 is what leads to its first port, not a signal of that name.
_PORT = re.compile(r"\bu(\d+)\b")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
# A constant may state its type: single(5), int8(3).
_CAST = re.compile(r"(?:u?int(?:8|16|32|64)|single|double|boolean)\s*\(([^()]*)\)$")


def comparisons(diagram: Diagram, only: Collection[Place] | None = None) -> Iterator[tuple[str, str]]:
    """Return comparisons as text with the block or chart that makes them.

    Args:
        diagram: the model.
        only: paths of the blocks to look at; None: all.
    """
    fed = feeding(diagram)
    for path, system in diagram.root.walk():
        leading = sources(system, fed.get(path, {}))
        for block in system.blocks:
            place = (*path, block.name)
            if not block.is_off and (only is None or place in only):
                for text in _compared(block, leading.get(block.name, {})):
                    yield text, "/".join(place)
    for chart in diagram.charts:
        if only is None or tuple(chart.name.split("/")) in only:
            texts = [t.label for t in chart.transitions] + [s.actions for s in chart.states] + [chart.script]
            yield from ((text, chart.name) for text in texts if text)


def constants(diagram: Diagram, place: str) -> Mapping[str, str]:
    """Return the values of the variables of the chart at a place that do not change; none of a block."""
    return {
        data.name: data.initial
        for chart in diagram.charts
        for data in chart.data
        if chart.name == place and data.initial and data.scope in ("constant", "parameter")
    }


def chart_names(diagram: Diagram, place: str) -> Mapping[str, str]:
    """Return what the variables of the chart at a place stand for outside it; empty text for its own ones."""
    chart = next((chart for chart in diagram.charts if chart.name == place), None)
    if chart is None:
        return {}
    fed = feeding(diagram).get(tuple(place.split("/")), {})
    own = {d.name: "" for d in chart.data if d.scope in ("local", "temporary")}
    inputs = {d.name: fed[d.name] for d in chart.data if d.scope == "input" and d.name in fed}
    return own | {name: text for name, text in inputs.items() if text != name}


def feeding(diagram: Diagram, *, named: bool = True) -> Mapping[Place, Mapping[str, str]]:
    """Return what leads to the inports of each subsystem, by the subsystem's path and the inport's name.

    Args:
        diagram: the model.
        named: whether to leave out blocks that only have a name of their own: the inport's says more, unless
            it is the name of another signal, one of the model's ports.
    """
    found: dict[Place, Mapping[str, str]] = {}
    ports = {*diagram.root.ports("Inport"), *diagram.root.ports("Outport")}
    for path, system in diagram.root.walk():
        leading = sources(system, found.get(path, {}))
        blocks = {quoted(b.name) for b in system.blocks if b.type not in ("Inport", "Outport")}
        for block in system.blocks:
            if block.system is not None and not block.is_off:
                inputs = leading.get(block.name, {})
                inner = {
                    name: inputs[str(i)]
                    for i, name in enumerate(block.system.ports("Inport"), start=1)
                    if str(i) in inputs
                }
                found[*path, block.name] = {
                    name: outer
                    for name, outer in inner.items()
                    if not named or outer not in blocks or name in ports
                }
    return found


def sources(system: BlockSystem, fed: Mapping[str, str]) -> Mapping[str, Mapping[str, str]]:
    """For each block, what leads to each input: a constant's value, or the name of a signal or block.

    Args:
        system: blocks and lines.
        fed: what leads to its inports from outside.
    """
    values = {b.name: _uncast(b.parameter("Value")) for b in system.blocks if b.type == "Constant"}
    inports, outports = set(system.ports("Inport")), set(system.ports("Outport"))
    found: dict[str, dict[str, str]] = {}
    for wire in system.wires:
        if wire.source is not None:
            outport = next((end.block for end in wire.targets if end.block in outports), "")
            own = wire.source.block if wire.source.block in inports else ""  # before the name of its line
            inner = own or wire.name or outport or wire.source.block
            name = values.get(wire.source.block) or fed.get(wire.source.block) or inner
            for target in wire.targets:
                found.setdefault(target.block, {})[target.port] = quoted(name)
    return found


def _uncast(value: str) -> str:
    found = _CAST.match(value.strip())
    return found[1].strip() if found else value


def quoted(name: str) -> str:
    """Write a name of several words in quotes, so that it stays one name; numbers stay as they are."""
    if name.isidentifier() or _NUMBER.match(name) or name.startswith("'"):
        return name
    return "'" + name.replace("'", " ").replace("\\", "/") + "'"


def _compared(block: Block, inputs: Mapping[str, str]) -> Iterator[str]:
    first = inputs.get("1", "u")
    if block.type == "RelationalOperator":
        yield f"{first} {_relation(block.parameter('Operator'))} {inputs.get('2', 'u2')}"
    elif block.type == "Switch":
        threshold = block.parameter("Threshold") or "0"
        stated = {"u2": inputs.get("2", "u2"), "Threshold": threshold}
        yield _relation(
            re.sub(r"\b(u2|Threshold)\b", lambda word: stated[word[0]], block.parameter("Criteria"))
        )
    elif block.type == "Relay":
        yield f"{first} >= {block.parameter('OnSwitchValue')}"
        yield f"{first} <= {block.parameter('OffSwitchValue')}"
    elif block.type in ("Saturate", "Saturation"):
        yield f"{first} < {block.parameter('UpperLimit')}"
        yield f"{first} > {block.parameter('LowerLimit')}"
    elif block.type == "Reference" and block.parameter("relop"):  # Compare To Constant
        yield f"{first} {_relation(block.parameter('relop'))} {block.parameter('const')}"
    elif block.type == "If":
        for text in (block.parameter("IfExpression"), *block.parameter("ElseIfExpressions").split(",")):
            yield _relation(_PORT.sub(lambda port: inputs.get(port[1], port[0]), text))
    elif block.type == "Fcn":
        yield _relation(re.sub(r"\bu\b(?!\()", lambda _: first, block.parameter("Expr")))


def _relation(operator: str) -> str:
    return operator.replace("~=", "!=")
