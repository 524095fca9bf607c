"""Comparisons in a block diagram, and what its blocks make of their inputs, as expressions."""

import re
from collections.abc import Collection, Iterator, Mapping

from falsifier.context.simulink.diagram import Block, BlockPath, BlockSystem, Chart, Diagram
from falsifier.context.thresholds import Threshold, at_breakpoints, thresholds, within

# Of an If block, u1 is what leads to its first port, not a signal of that name.
_PORT = re.compile(r"\bu(\d+)\b")
_NUMBER = re.compile(r"[-+]?(\d++\.?\d*+|\.\d++)([eE][-+]?\d++)?$")
# Tables by type: the parameter that has the breakpoints of each input.
_TABLES: Mapping[str, Mapping[str, str]] = {
    "Lookup": {"1": "InputValues"},
    "Lookup2D": {"1": "RowIndex", "2": "ColumnIndex"},
    "Lookup_n-D": {str(i): f"BreakpointsForDimension{i}" for i in range(1, 6)},
}
# A constant may state its type: single(5), int8(3).
_CAST = re.compile(r"(?:u?int(?:8|16|32|64)|single|double|boolean)\s*\(([^()]*)\)$")
# Blocks whose output is their input later, in another type, or after some time.
_LISTED = """
    DataTypeConversion SignalConversion RateTransition ZeroOrderHold UnitDelay Memory Delay InitialCondition
    TransportDelay VariableTransportDelay RateLimiter Quantizer TransferFcn DiscreteTransferFcn DiscreteFilter
    Saturate Saturation DeadZone Backlash Goto
"""
_FOLLOWING = frozenset(_LISTED.split())
_MAX_BLOCKS = 20_000


def diagram_thresholds(diagram: Diagram, only: Collection[BlockPath] | None = None) -> Iterator[Threshold]:
    """Return the comparisons with constants, and the breakpoints of tables.

    Args:
        diagram: the model.
        only: paths of the blocks to look at; None: all.
    """
    fed = feeding(diagram)
    names = {chart.name: _chart_names(chart, fed) for chart in diagram.charts}
    constants = {chart.name: _chart_constants(chart) for chart in diagram.charts}
    for text, place in comparisons(diagram, only):
        told = f"{diagram.name}/{place}"
        for threshold in thresholds([(text, 0)], constants.get(place, {}), told):
            yield within(threshold, names.get(place, {}))
    for path, block, inputs in _reached(diagram, only):
        for signal, values in _breakpoints(block, inputs):
            yield at_breakpoints(signal, values, f"{diagram.name}/{'/'.join(path)}")


def comparisons(diagram: Diagram, only: Collection[BlockPath] | None = None) -> Iterator[tuple[str, str]]:
    """Return comparisons as text with the block or chart that makes them."""
    for place, block, inputs in _reached(diagram, only):
        for text in _compared(block, inputs):
            yield text, "/".join(place)
    for chart in diagram.charts:
        if only is None or tuple(chart.name.split("/")) in only:
            texts = [t.label for t in chart.transitions] + [s.actions for s in chart.states] + [chart.script]
            yield from ((text, chart.name) for text in texts if text)


def _reached(
    diagram: Diagram, only: Collection[BlockPath] | None
) -> Iterator[tuple[BlockPath, Block, Mapping[str, str]]]:
    """Return the blocks to look at, with their paths and what leads to each of their inputs."""
    fed = feeding(diagram)
    for path, system in diagram.root.walk():
        leading = sources(system, fed.get(path, {}))
        for block in system.blocks:
            place = (*path, block.name)
            if not block.is_off and (only is None or place in only):
                yield place, block, leading.get(block.name, {})


def _chart_constants(chart: Chart) -> Mapping[str, str]:
    """Return the values of the variables of a chart that do not change."""
    return {d.name: d.initial for d in chart.data if d.initial and d.scope in ("constant", "parameter")}


def _chart_names(chart: Chart, feeding: Mapping[BlockPath, Mapping[str, str]]) -> Mapping[str, str]:
    """Return what the variables of a chart stand for outside it; empty text for its own ones."""
    fed = feeding.get(tuple(chart.name.split("/")), {})
    own = {d.name: "" for d in chart.data if d.scope in ("local", "temporary")}
    inputs = {d.name: fed[d.name] for d in chart.data if d.scope == "input" and d.name in fed}
    return own | {name: text for name, text in inputs.items() if text != name}


def _breakpoints(block: Block, inputs: Mapping[str, str]) -> Iterator[tuple[str, list[str]]]:
    """Return what leads to each input of a table, with its breakpoints if they are numbers."""
    for port, name in _TABLES.get(block.type, {}).items():
        values = block.parameter(name).strip("[] ").replace(",", " ").split()
        if port in inputs and values and all(_NUMBER.match(value) for value in values):
            yield inputs[port], values


def feeding(diagram: Diagram, *, named: bool = True) -> Mapping[BlockPath, Mapping[str, str]]:
    """Return what leads to the inports of each subsystem, by the subsystem's path and the inport's name.

    Args:
        diagram: the model.
        named: whether to leave out blocks that only have a name of their own: the inport's says more, unless
            it is the name of another signal, one of the model's ports.
    """
    found: dict[BlockPath, Mapping[str, str]] = {}
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


def definitions(diagram: Diagram) -> Mapping[str, str]:
    """Return expressions by the names of signals, as far as gains, sums and the like make them.

    A name that stands for different expressions in two systems is left out.
    """
    found: dict[str, str] = {}
    ambiguous = set()
    blocks = 0
    fed, all_fed = feeding(diagram), feeding(diagram, named=False)
    for path, system in diagram.root.walk():
        blocks += len(system.blocks)
        if blocks > _MAX_BLOCKS:
            break
        for name, expression in _of(system, fed.get(path, {}), all_fed.get(path, {})):
            if name != expression and found.setdefault(name, expression) != expression:
                ambiguous.add(name)
    return {name: text for name, text in found.items() if name not in ambiguous}


def _of(system: BlockSystem, fed: Mapping[str, str], all_fed: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    leading = sources(system, fed)
    own = {block.name: block for block in system.blocks if not block.is_off}
    outports = set(system.ports("Outport"))
    for wire in system.wires:
        block = own.get(wire.source.block) if wire.source is not None else None
        if block is None:
            continue
        expression = all_fed.get(block.name) or _made(block, leading.get(block.name, {}))
        outport = next((end.block for end in wire.targets if end.block in outports), "")
        for name in (wire.name, outport, block.name):
            if name and expression:
                yield name, expression


def _made(block: Block, inputs: Mapping[str, str]) -> str:
    """Return the expression of a block's output; empty if it is not known."""
    first = inputs.get("1", "")
    if block.type == "Inport":
        return quoted(block.name)
    if not first:
        return ""
    if block.type in _FOLLOWING:
        return first
    if block.type == "Gain":
        return f"({block.parameter('Gain')}) * ({first})"
    if block.type == "Abs":
        return f"abs({first})"
    if block.type == "MinMax":
        return f"{block.parameter('Function') or 'min'}({', '.join(inputs.values())})"
    if block.type == "Sum":
        return _sum(block.parameter("Inputs") or "++", inputs)
    return ""


def _sum(signs: str, inputs: Mapping[str, str]) -> str:
    listed = "+" * int(signs) if signs.isdigit() and int(signs) < 100 else re.sub(r"[^+-]", "", signs)
    terms = [f"{sign} ({inputs[str(i)]})" for i, sign in enumerate(listed, start=1) if str(i) in inputs]
    return " ".join(terms) if len(terms) == len(listed) else ""
