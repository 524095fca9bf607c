from pathlib import Path

from falsifier.context.simulink.diagram import (
    Block,
    BlockSystem,
    Chart,
    ChartData,
    Diagram,
    End,
    Wire,
    upstream,
)
from falsifier.context.simulink.reader import read_diagram
from tests.fixtures import simulink


def test_blocks_behind_a_signal_are_left_out(tmp_path: Path) -> None:
    diagram = read_diagram(simulink.write_slx(tmp_path / "a.slx"))
    found = upstream(diagram, ["limphome.power"])
    assert found is not None
    # The feedback over the bath is part of it, the safety switch behind it is not.
    assert {("Mode logic",), ("Controller", "Integral"), ("Bath",), ("disagreement",)} <= found
    assert not {("Safety switch",), ("trips",), ("Controller", "Scope")} & found
    assert ("Safety switch",) in (upstream(diagram, ["trips"]) or ())


def test_tags_lead_from_goto_to_from() -> None:
    inner = BlockSystem((Block("Constant", "c"), Block("Goto", "g", (("GotoTag", "T"),))))
    inner = BlockSystem(inner.blocks, (Wire(End("c", "1"), (End("g", "1"),)),))
    blocks = (
        Block("SubSystem", "s", system=inner),
        Block("From", "f", (("GotoTag", "T"),)),
        Block("Outport", "y", number=1),
        Block("Gain", "alone"),
    )
    diagram = Diagram("m", BlockSystem(blocks, (Wire(End("f", "1"), (End("y", "1"),)),)))
    assert upstream(diagram, ["y"]) == frozenset({("y",), ("f",), ("s",), ("s", "g"), ("s", "c")})


def test_what_enables_a_system_and_what_a_chart_writes_count() -> None:
    inner = BlockSystem(
        (Block("Constant", "c"), Block("EnablePort", "e"), Block("Outport", "y")),
        (Wire(End("c", "1"), (End("y", "1"),), "value"),),
    )
    read = Block("DataStoreRead", "r", (("DataStoreName", "store"),))
    blocks = (
        read,
        Block("SubSystem", "s", system=inner),
        Block("SubSystem", "C", is_chart=True),
        Block("Gain", "k"),
    )
    wires = (Wire(End("r", "1"), (End("s", "enable"),)),)
    chart = Chart("C", data=(ChartData("store", "data_store_memory"),))
    found = upstream(Diagram("m", BlockSystem(blocks, wires), (chart,)), ["value"])
    assert found == frozenset({("s",), ("s", "c"), ("s", "e"), ("s", "y"), ("r",), ("C",)})


def test_without_the_signal_nothing_can_be_left_out() -> None:
    assert upstream(Diagram("m", BlockSystem((Block("Gain", "k"),))), ["other"]) is None
