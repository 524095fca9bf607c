from falsifier.context.simulink.diagram import ChartData, State, Transition
from falsifier.context.simulink.sections import Node, parse_mdl
from falsifier.context.simulink.stateflow import read_charts
from tests.fixtures import simulink

SCRIPT = "function y = f(u)\ny = u > 3;"


def test_states_transitions_and_data() -> None:
    (chart,) = read_charts(parse_mdl(simulink.MDL, "a.mdl"))
    assert (chart.name, chart.sample_time) == ("Mode logic", "0.1")
    assert chart.states == (
        State("Normal"),
        State("Limp", "entry: limp = true;\nexit: limp = false;"),
        State("Limp.Frozen", "entry: frozen = true;"),
        State("Limp.Winding"),
    )
    assert Transition("", "Limp.Frozen", "[age >= 1.5]") in chart.transitions
    enter = "[disagreement > 6.8 && disagreement < 7.2]{age = t - ended;}"
    assert Transition("Normal", "Limp", enter) in chart.transitions
    assert Transition("", "Normal") in chart.transitions
    assert ChartData("age", "local", "1e6") in chart.data
    assert ChartData("disagreement", "input") in chart.data


def test_parallel_states_junctions_and_notes() -> None:
    end = Node("dst", {"SSID": "3"})
    items = (
        Node("state", {"SSID": "1", "labelString": "A", "type": "AND_STATE"}),
        Node("state", {"SSID": "2", "labelString": "a note", "isNoteBox": "1"}),
        Node("junction", {"SSID": "3"}),
        Node("transition", {"SSID": "4", "labelString": "[u > 1]"}, (Node("src", {"SSID": "1"}), end)),
        Node("transition", {"SSID": "5"}, (Node("src", {"SSID": "1"}), Node("dst"))),  # leads nowhere
    )
    (chart,) = read_charts(Node("file", {}, (Node("chart", {"id": "9", "name": "C"}, items),)))
    assert chart.states == (State("A", is_parallel=True),)
    assert chart.transitions == (Transition("A", "junction 1", "[u > 1]"),)


def test_a_matlab_function_is_its_code() -> None:
    kernel = Node(
        "state", {"SSID": "1", "labelString": "eML_blk_kernel()"}, (Node("eml", {"script": SCRIPT}),)
    )
    data = Node("data", {"SSID": "2", "name": "u", "scope": "INPUT_DATA"})
    (chart,) = read_charts(Node("file", {}, (Node("chart", {"name": "F"}, (kernel, data)),)))
    assert (chart.script, chart.states, chart.data) == (SCRIPT, (), (ChartData("u", "input"),))
