from pathlib import Path

import pytest

from falsifier.context.simulink.comparisons import diagram_thresholds
from falsifier.context.simulink.diagram import (
    Block,
    BlockSystem,
    Chart,
    ChartData,
    Diagram,
    End,
    Transition,
    Wire,
    upstream,
)
from falsifier.context.simulink.reader import read_diagram
from tests.fixtures import simulink


def told(diagram: Diagram) -> list[tuple[str, str]]:
    return [(t.text, t.place) for t in diagram_thresholds(diagram)]


def test_blocks_and_charts_that_compare(tmp_path: Path) -> None:
    diagram = read_diagram(simulink.write_slx(tmp_path / "a.slx"))
    found = told(diagram)
    assert ("temperature >= 64", "limphome/Safety switch") in found
    assert ("Command < 30", "limphome/Controller/Limit") in found
    assert ("limp >= 0", "limphome/Controller/Limited") in found
    assert ("age >= 1.5", "limphome/Mode logic") in found
    behind = {t.place for t in diagram_thresholds(diagram, upstream(diagram, ["power"]))}
    assert "limphome/Safety switch" not in behind
    assert "limphome/Mode logic" in behind


def test_ports_in_expressions_are_named_by_what_leads_to_them() -> None:
    blocks = (
        Block("Inport", "u2", number=1),
        Block("Inport", "Threshold speed", number=2),
        Block("If", "if", (("IfExpression", "u1 > 3"), ("ElseIfExpressions", "u2 ~= 4, u1 < 1"))),
        Block("Fcn", "fcn", (("Expr", "u > 5"),)),
        Block("Fcn", "itself", (("Expr", "u > 5 * Expr"),)),
        Block("Switch", "s", (("Criteria", "u2 > Threshold"), ("Threshold", "7"))),
    )
    wires = (
        Wire(End("u2", "1"), (End("if", "1"), End("fcn", "1"), End("itself", "1"))),
        Wire(End("Threshold speed", "1"), (End("if", "2"), End("s", "2"))),
    )
    texts = [text for text, _ in told(Diagram("m", BlockSystem(blocks, wires)))]
    speed = "'Threshold speed'"
    assert texts == ["u2 > 3", f"{speed} != 4", "u2 < 1", "u2 > 5", "u2 > 5 * Expr", f"{speed} > 7"]


@pytest.mark.parametrize(
    ("value", "expected"),
    [("1E-3", ["u > 1E-3"]), ("single(5)", ["u > 5"]), ("-.5", ["u > -.5"]), ("-K", [])],
)
def test_numbers_and_types_of_constants_are_understood(value: str, expected: list[str]) -> None:
    blocks = (
        Block("Inport", "u"),
        Block("Constant", "Limit", (("Value", value),)),
        Block("RelationalOperator", "Above", (("Operator", ">"),)),
    )
    wires = tuple(
        Wire(End(name, "1"), (End("Above", str(port)),)) for port, name in enumerate(("u", "Limit"), start=1)
    )
    assert [text for text, _ in told(Diagram("m", BlockSystem(blocks, wires)))] == expected


def test_names_within_a_subsystem_or_chart_are_those_of_what_leads_there() -> None:
    inner = BlockSystem(
        (Block("Inport", "u", number=1), Block("Relay", "Trip", (("OnSwitchValue", "3"),))),
        (Wire(End("u", "1"), (End("Trip", "1"),)),),
    )
    data = (ChartData("d", "input"), ChartData("u", "local"), ChartData("y", "output"))
    chart = Chart("Logic", (), (Transition("", "On", "[d > 4 && u > 5]"),), data)
    blocks = (
        Block("Inport", "u", number=1),
        Block("Inport", "speed", number=2),
        Block("SubSystem", "Guard", system=inner),
        Block("SubSystem", "Logic", is_chart=True, inputs=("d",)),
    )
    wires = (Wire(End("speed", "1"), (End("Guard", "1"), End("Logic", "1")), "v"),)
    diagram = Diagram("m", BlockSystem(blocks, wires), charts=(chart,))
    found = [(t.text, set(t.names)) for t in diagram_thresholds(diagram)]
    assert found == [("speed >= 3", {"speed"}), ("d > 4 (d = speed)", {"speed"}), ("u > 5", set())]
