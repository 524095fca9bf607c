from falsifier.context.simulink.definitions import definitions
from falsifier.context.simulink.diagram import Block, BlockSystem, Diagram, End, Wire


def wire(source: str, target: str, port: int = 1, name: str = "") -> Wire:
    return Wire(End(source, "1"), (End(target, str(port)),), name)


INNER = BlockSystem(
    (Block("Inport", "e", number=1), Block("Abs", "Size"), Block("Outport", "size", number=1)),
    (wire("e", "Size"), wire("Size", "size")),
)
ROOT = BlockSystem(
    (
        Block("Inport", "u", number=1),
        Block("Constant", "Set", (("Value", "single(5)"),)),
        Block("Gain", "Twice", (("Gain", "2"),)),
        Block("Sum", "Error", (("Inputs", "|+-"),)),
        Block("UnitDelay", "Last value"),
        Block("SubSystem", "Judge", system=INNER),
        Block("Product", "Unknown"),
        Block("Terminator", "End"),
    ),
    (
        wire("u", "Twice", name="raw"),
        wire("Set", "Error"),
        wire("Twice", "Error", 2),
        wire("Error", "Last value"),
        wire("Last value", "Judge"),
        wire("Unknown", "End", name="p"),
    ),
)


def test_names_stand_for_what_blocks_make() -> None:
    found = definitions(Diagram("m", ROOT))
    assert found["raw"] == "u"
    assert found["Twice"] == "(2) * (u)"
    assert found["Error"] == "+ (5) - (Twice)"
    assert found["Last value"] == "Error"
    assert found["e"] == "'Last value'"  # an inport within is what leads to its block
    assert found["Size"] == "abs(e)"
    assert "p" not in found


def test_a_name_with_two_meanings_is_left_out() -> None:
    blocks = (Block("Inport", "e"), Block("Gain", "Size", (("Gain", "3"),)), Block("Outport", "o"))
    other = BlockSystem(blocks, (wire("e", "Size"), wire("Size", "o")))
    root = BlockSystem((*ROOT.blocks, Block("SubSystem", "Second", system=other)), ROOT.wires)
    assert "Size" not in definitions(Diagram("m", root))
