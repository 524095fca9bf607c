"""What blocks make of their inputs, as expressions of the names that comparisons have."""

import re
from collections.abc import Iterator, Mapping

from falsifier.context.simulink.conditions import feeding, quoted, sources
from falsifier.context.simulink.diagram import Block, BlockSystem, Diagram

# Blocks whose output is their input later, in another type, or after some time.
_LISTED = """
    DataTypeConversion SignalConversion RateTransition ZeroOrderHold UnitDelay Memory Delay InitialCondition
    TransportDelay VariableTransportDelay RateLimiter Quantizer TransferFcn DiscreteTransferFcn DiscreteFilter
    Saturate Saturation DeadZone Backlash Goto
"""
_FOLLOWING = frozenset(_LISTED.split())
_MAX_BLOCKS = 20_000


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
