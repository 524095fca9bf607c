from pathlib import Path

import pytest

from falsifier.context.simulink.conditions import chart_names, comparisons, constants
from falsifier.context.simulink.diagram import Block, BlockSystem, Chart, ChartData, Diagram, End, Wire
from falsifier.context.simulink.reader import read_diagram
from falsifier.context.simulink.upstream import upstream
from tests.fixtures import simulink


def test_blocks_and_charts_that_compare(tmp_path: Path) -> None:
    diagram = read_diagram(simulink.write_slx(tmp_path / "a.slx"))
    found = list(comparisons(diagram))
    assert ("temperature >= 64", "Safety switch") in found
    assert ("Command < 30", "Controller/Limit") in found
    assert ("limp >= 0", "Controller/Limited") in found
    assert ("[age >= 1.5]", "Mode logic") in found
    behind = {place for _, place in comparisons(diagram, upstream(diagram, ["power"]))}
    assert "Safety switch" not in behind
    assert "Mode logic" in behind


def test_constants_and_names_of_several_words() -> None:
    blocks = (
        Block("Constant", "c", (("Value", "2.5"),)),
        Block("Gain", "my gain"),
        Block("RelationalOperator", "r", (("Operator", "~="),)),
        Block("Reference", "cmp", (("relop", "<="), ("const", "7"))),
    )
    wires = (
        Wire(End("my gain", "1"), (End("r", "1"), End("cmp", "1"))),
        Wire(End("c", "1"), (End("r", "2"),)),
    )
    chart = Chart("C", data=(ChartData("limit", "constant", "3"), ChartData("x", "local", "1")))
    other = Chart("D", data=(ChartData("limit", "constant", "4"),))
    diagram = Diagram("m", BlockSystem(blocks, wires), (chart, other))
    assert list(comparisons(diagram)) == [("'my gain' != 2.5", "r"), ("'my gain' <= 7", "cmp")]
    assert constants(diagram, "C") == {"limit": "3"}
    assert constants(diagram, "r") == {}, "blocks do not see the variables of charts"


def test_ports_in_expressions_are_named_by_what_leads_to_them() -> None:
    blocks = (
        Block("Inport", "u2", number=1),
        Block("Inport", "Threshold speed", number=2),
        Block("If", "if", (("IfExpression", "u1 > 3"), ("ElseIfExpressions", "u2 ~= 4, u1 < 1"))),
        Block("Fcn", "fcn", (("Expr", "u > 5"),)),
        Block("Switch", "s", (("Criteria", "u2 > Threshold"), ("Threshold", "7"))),
    )
    wires = (
        Wire(End("u2", "1"), (End("if", "1"), End("fcn", "1"))),
        Wire(End("Threshold speed", "1"), (End("if", "2"), End("s", "2"))),
    )
    texts = [text.strip() for text, _ in comparisons(Diagram("m", BlockSystem(blocks, wires)))]
    speed = "'Threshold speed'"
    assert texts == ["u2 > 3", f"{speed} != 4", "u2 < 1", "u2 > 5", f"{speed} > 7"]


@pytest.mark.parametrize(
    ("value", "told"), [("1E-3", "1E-3"), ("single(5)", "5"), ("-.5", "-.5"), ("-K", "'-K'")]
)
def test_numbers_and_types_of_constants_are_understood(value: str, told: str) -> None:
    blocks = (
        Block("Inport", "u"),
        Block("Constant", "Limit", (("Value", value),)),
        Block("RelationalOperator", "Above", (("Operator", ">"),)),
    )
    wires = tuple(
        Wire(End(name, "1"), (End("Above", str(port)),)) for port, name in enumerate(("u", "Limit"), start=1)
    )
    assert list(comparisons(Diagram("m", BlockSystem(blocks, wires)))) == [(f"u > {told}", "Above")]


def test_names_within_a_subsystem_or_chart_are_those_of_what_leads_there() -> None:
    inner = BlockSystem(
        (Block("Inport", "u", number=1), Block("Relay", "Trip", (("OnSwitchValue", "3"),))),
        (Wire(End("u", "1"), (End("Trip", "1"),)),),
    )
    chart = Chart("Logic", data=(ChartData("d", "input"), ChartData("u", "local"), ChartData("y", "output")))
    ports = BlockSystem((Block("Inport", "d", number=1),))
    blocks = (
        Block("Inport", "u", number=1),
        Block("Inport", "speed", number=2),
        Block("SubSystem", "Guard", system=inner),
        Block("SubSystem", "Logic", system=ports, is_chart=True),
    )
    wires = (Wire(End("speed", "1"), (End("Guard", "1"), End("Logic", "1")), "v"),)
    diagram = Diagram("m", BlockSystem(blocks, wires), charts=(chart,))
    assert ("speed >= 3", "Guard/Trip") in list(comparisons(diagram))
    assert chart_names(diagram, "Logic") == {"d": "speed", "u": ""}
    assert chart_names(diagram, "Guard") == {}
