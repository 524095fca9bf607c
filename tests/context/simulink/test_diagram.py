from falsifier.context.simulink.diagram import Block, BlockSystem

INNER = BlockSystem((Block("Gain", "k", (("Gain", "2"),)),))
SYSTEM = BlockSystem(
    (
        Block("Inport", "b", number=2),
        Block("Inport", "a", number=1),
        Block("Inport", "off", number=3, is_off=True),
        Block("SubSystem", "s", system=INNER),
    )
)


def test_ports_are_in_the_order_of_their_numbers() -> None:
    assert SYSTEM.ports("Inport") == ("a", "b")
    assert SYSTEM.ports("Outport") == ()


def test_systems_are_walked_with_their_paths() -> None:
    assert list(SYSTEM.walk()) == [((), SYSTEM), (("s",), INNER)]
    assert INNER.blocks[0].parameter("Gain") == "2"
    assert INNER.blocks[0].parameter("none") == ""
