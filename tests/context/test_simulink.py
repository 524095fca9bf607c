"""Simulink files, read and told."""

from collections.abc import Collection, Iterable
from pathlib import Path

import pytest

from falsifier.context.simulink import names_text, read_diagram, sections, structure_text
from falsifier.context.simulink.diagram import (
    BlockSystem,
    Chart,
    ChartData,
    Diagram,
    End,
    State,
    Transition,
    Wire,
    upstream,
)
from falsifier.context.simulink.sections import Node
from falsifier.context.simulink.stateflow import read_charts
from falsifier.errors import FalsifierError, ModelError, SpecError
from tests.fixtures import simulink

BLOCK = 'Block {{\nBlockType {0}\nName "{1}"\n{2}\n}}\n'


def drawn(folder: Path, blocks: Iterable[str], wires: Iterable[tuple[str, str]] = ()) -> Diagram:
    """A model of these blocks, each ``Type name`` with lines for its content behind it."""
    text = "".join(BLOCK.format(*b.partition("\n")[0].split(), b.partition("\n")[2]) for b in blocks)
    for source, target in wires:
        text += f'Line {{\nSrcBlock "{source}"\nSrcPort 1\nDstBlock "{target}"\nDstPort 1\n}}\n'
    path = folder / "m.mdl"
    path.write_text(f'Model {{\nName "m"\nSystem {{\n{text}}}\n}}\n')
    return read_diagram(path)


def before(diagram: Diagram, *signals: str) -> Collection[str]:
    """The blocks on which signals depend."""
    found = upstream(diagram, signals)
    assert found is not None
    return {"/".join(path) for path in found}


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """The same model in the four forms in which versions of Simulink write it."""
    written = {
        "newer": simulink.write_slx(tmp_path / "limphome.slx"),
        "older": simulink.write_slx(tmp_path / "older.slx", simulink.older_parts()),
        "text": tmp_path / "limphome.mdl",
        "package": tmp_path / "package.mdl",
    }
    written["text"].write_text(simulink.MDL)
    written["package"].write_text(simulink.text_package())
    return written


def test_all_forms_say_the_same(files: dict[str, Path]) -> None:
    newer, *others = map(read_diagram, files.values())
    assert all(other == newer for other in others)


def test_blocks_lines_ports_and_settings(files: dict[str, Path]) -> None:
    diagram = read_diagram(files["newer"])
    assert diagram.name == "limphome"
    assert dict(diagram.settings) == {"StopTime": "40", "Solver": "FixedStepDiscrete", "FixedStep": "0.1"}
    root = diagram.root
    assert root.ports("Inport") == ("disagreement", "set point")
    assert root.ports("Outport") == ("temperature", "trips")
    blocks = {block.name: block for block in root.blocks}
    assert blocks["Mode logic"].is_chart and blocks["Mode logic"].inputs == ("disagreement",)
    assert root.wires[0] == Wire(End("disagreement", "1"), (End("Mode logic", "1"),), "difference")
    assert {end.block for end in root.wires[5].targets} == {"temperature", "Safety switch", "Controller"}
    controller = blocks["Controller"].system
    assert controller is not None
    inner = {block.name: block for block in controller.blocks}
    assert inner["Limited"].parameter("Threshold") == "0"  # of all switches
    assert inner["Integral"].parameter("UpperSaturationLimit") == "100"
    assert End("Integral", "enable") in {end for wire in controller.wires for end in wire.targets}


def test_states_transitions_and_data(files: dict[str, Path]) -> None:
    (chart,) = read_diagram(files["text"]).charts
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
    assert {ChartData("age", "local", "1e6"), ChartData("disagreement", "input")} <= set(chart.data)


def charts(*items: Node) -> list[Chart]:
    return list(read_charts(Node("file", {}, (Node("chart", {"id": "9", "name": "C"}, items),))))


def test_parallel_states_junctions_notes_and_matlab_functions() -> None:
    end = Node("dst", {"SSID": "3"})
    (chart,) = charts(
        Node("state", {"SSID": "1", "labelString": "A", "type": "AND_STATE"}),
        Node("state", {"SSID": "2", "labelString": "a note", "isNoteBox": "1"}),
        Node("junction", {"SSID": "3"}),
        Node("transition", {"SSID": "4", "labelString": "[u > 1]"}, (Node("src", {"SSID": "1"}), end)),
        Node("transition", {"SSID": "5"}, (Node("src", {"SSID": "1"}), Node("dst"))),  # leads nowhere
    )
    assert chart.states == (State("A", is_parallel=True),)
    assert chart.transitions == (Transition("A", "junction 1", "[u > 1]"),)
    script = "function y = f(u)\ny = u > 3;"
    kernel = Node(
        "state", {"SSID": "1", "labelString": "eML_blk_kernel()"}, (Node("eml", {"script": script}),)
    )
    (chart,) = charts(kernel, Node("data", {"SSID": "2", "name": "u", "scope": "INPUT_DATA"}))
    assert (chart.script, chart.states, chart.data) == (script, (), (ChartData("u", "input"),))
    told = structure_text(Diagram("m", BlockSystem(), (chart,)))
    assert told.endswith("MATLAB function C\n- input: u\n  function y = f(u)\n  y = u > 3;")


def test_structure_has_parameters_sources_and_conditions(files: dict[str, Path]) -> None:
    diagram = read_diagram(files["newer"])
    text = structure_text(diagram)
    for line in (
        "Model limphome (StopTime 40; Solver FixedStepDiscrete; FixedStep 0.1)",
        "- Controller: SubSystem <- Mode logic, Mode logic:2, set point, Bath",
        "- Bath: TransferFcn (Numerator = [80], Denominator = [40 1]) <- Controller 'power'",
        "- Limited: Switch (Criteria = u2 >= Threshold, Threshold = 0) <- Limit, limp, Command",
        "- start -> Limp.Frozen [age >= 1.5]",
        "- Normal -> Limp [disagreement > 6.8 && disagreement < 7.2]{age = t - ended;}",
        "- Scope: Scope, commented out",
    ):
        assert line in text.splitlines()
    assert "<- Error, enable: frozen" in text
    assert "stands for simulink/Sources/Counter Limited (not followed)" in text
    names = names_text(diagram)
    assert "inports disagreement, set point" in names and "Controller: outports power" in names
    assert "Chart Mode logic: Normal, Limp, Limp.Frozen, Limp.Winding" in names and "6.8" not in names


@pytest.mark.parametrize(
    ("block", "told"),
    [
        ("Gain k\nGain 5\nPosition [0, 0, 1, 1]\nSampleTime -1", "k: Gain (Gain = 5)"),
        ("Integrator k\nInitialCondition 1\nUpperSaturationLimit 3", "k: Integrator (InitialCondition = 1)"),
        (
            "Integrator k\nInitialCondition 1\nLimitOutput on\nUpperSaturationLimit 3",
            "k: Integrator (InitialCondition = 1, LimitOutput = on, UpperSaturationLimit = 3)",
        ),
        ('Mask k\nPosition [1]\nMaskIconOpaque on\nuplimit "3\\n4"\nempty []', "k: Mask (uplimit = 3 4)"),
        ('PID k\nP 5\nPDataTypeStr "Inherit: rule"\nPParamMin []\nAccumMode "Inherited"', "k: PID (P = 5)"),
    ],
)
def test_only_parameters_with_a_meaning_are_told(tmp_path: Path, block: str, told: str) -> None:
    assert f"- {told}" in structure_text(drawn(tmp_path, [block])).splitlines()


def test_blocks_behind_a_signal_are_left_out(files: dict[str, Path], tmp_path: Path) -> None:
    diagram = read_diagram(files["newer"])
    found = before(diagram, "limphome.power")
    # The feedback over the bath is part of it, the safety switch behind it is not.
    assert {"Mode logic", "Controller/Integral", "Bath", "disagreement"} <= set(found)
    assert not {"Safety switch", "trips", "Controller/Scope"} & set(found)
    assert "Safety switch" in before(diagram, "trips")
    assert upstream(diagram, ["other"]) is None, "nothing can be left out"
    inport = diagram.root.ports("Inport")[0]
    assert upstream(diagram, [inport]) is None, "a controller may act on what it measures"
    assert inport in before(diagram, inport, "trips")
    inner = f"SubSystem s\nSystem {{\n{BLOCK.format('Inport', 'v', '')}}}"
    assert upstream(drawn(tmp_path, ["Inport v", inner, "Gain k"], [("v", "s")]), ["v"]) is None
    text = structure_text(diagram, upstream(diagram, ["power"]))
    assert "Safety switch" not in text
    assert "(4 blocks left out: in this file, nothing required depends on them)" in text


def test_tags_enabling_ports_and_data_stores_lead_to_what_depends_on_them(tmp_path: Path) -> None:
    inner = BLOCK.format("Constant", "c", "") + BLOCK.format("Goto", "g", "GotoTag T")
    inner += BLOCK.format("EnablePort", "e", "")
    line = 'Line {\nSrcBlock "c"\nSrcPort 1\nDstBlock "g"\nDstPort 1\n}\n'
    blocks = (
        f"SubSystem s\nSystem {{\n{inner}{line}}}",
        "From f\nGotoTag T",
        "Outport y",
        "Gain alone",
        "DataStoreRead r\nDataStoreName store",
    )
    diagram = drawn(tmp_path, blocks, [("f", "y")])
    assert before(diagram, "y") == {"y", "f", "s", "s/g", "s/c", "s/e"}
    chart = Chart("C", data=(ChartData("store", "data_store_memory"),))
    assert before(Diagram("m", diagram.root, (chart,)), "r") == {"r", "C"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Stateflow {\n}\n", "expected a model or library, found Stateflow"),
        ("", "found nothing"),
        ("Model {\n}\n", "has no system of blocks"),
        ("Model {\nSystem {\nBlock {\nBlockType Gain\n}\n}\n}\n", "a block of the model has no name"),
        ('Model {\nSystem {\nBlock {\nName "a"\n}\n}\n}\n', "has no type .*; save it again"),
        ('Model {\nSystem {\nLine {\nSrcBlock "a"\n}\n}\n}\n', "ends at 'a', which is no block there; save"),
        ("MATLAB\0\0", "found binary data"),
        ('Model {\n  Name "a"\n', "the section Model of line 1 is not closed"),
        ("}\n", "line 1: a section is closed that was not opened"),
        ('Model {\n  Name "a\n}\n', "line 2: expected NAME VALUE"),
        ("Model {\n  ???\n}\n", "line 2: expected NAME VALUE"),
        ('Model {\n  "piece"\n}\n', "line 2: expected"),
        ("A {\n" * 300, "nested more than 200 deep"),
    ],
)
def test_what_is_no_model_is_an_error(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.mdl"
    path.write_text(text)
    with pytest.raises(SpecError, match=f"a.mdl: .*{message}"):
        read_diagram(path)


@pytest.mark.parametrize(
    "parents", [[(3, 2), (2, 2)], [(3, 2), (4, 3), (3, 4)], [(k, k - 1) for k in range(3, 2000)]]
)
def test_states_may_be_in_each_other_and_nested_deep(parents: list[tuple[int, int]]) -> None:
    states = (
        f"state {{\nid {number}\nlabelString S\ntreeNode [{parent} 0 0 0]\n}}\n" for number, parent in parents
    )
    (chart,) = read_charts(
        sections.parse_mdl(f"Stateflow {{\nchart {{\nid 2\n}}\n{''.join(states)}}}\n", "a.mdl")
    )
    assert {s.name.rpartition(".")[2] for s in chart.states} == {"S"}


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("simulink/systems/system_4.xml", "<System><Block", "system_4.xml: not well-formed XML"),
        ("simulink/systems/system_4.xml", None, "the part system_4.xml is missing"),
        ("simulink/blockdiagram.xml", None, "the part simulink/blockdiagram.xml is missing"),
        (
            "simulink/systems/system_4.xml",
            '<System><System Ref="system_root"/></System>',
            "which contains it",
        ),
        ("simulink/stateflow/chart_14.xml", '<!DOCTYPE x><chart id="14"/>', "chart_14.xml: refused"),
    ],
)
def test_errors_name_the_part(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    changed = simulink.newer_parts()
    if text is None:
        del changed[name]
    else:
        changed[name] = text
    with pytest.raises(SpecError, match=f"a.slx: .*{message}"):
        read_diagram(simulink.write_slx(tmp_path / "a.slx", changed))


def test_damaged_archives_are_named(tmp_path: Path) -> None:
    path = simulink.write_slx(tmp_path / "a.slx")
    whole = path.read_bytes()
    path.write_bytes(whole[:200])
    with pytest.raises(ModelError, match=r"not a readable Simulink file.*; copy the file again"):
        read_diagram(path)
    with pytest.raises(ModelError, match=r"gone\.slx: no such file; correct the path"):
        read_diagram(tmp_path / "gone.slx")
    start = whole.index(b"simulink/systems/system_root.xml") + 32
    path.write_bytes(whole[:start] + bytes(40) + whole[start + 40 :])
    with pytest.raises(FalsifierError, match=r"system_root\.xml is damaged"):
        read_diagram(path)
    with pytest.raises(SpecError, match="cannot be read"):
        read_diagram(tmp_path / "none.mdl")


def test_only_line_breaks_end_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.mdl"
    path.write_text('Model {\r\n Name "a"\r\n Description "one\f\u2028two"\r\n System {\r\n }\r\n}', "utf-8")
    assert read_diagram(path).name == "a"


def test_bombs_and_parts_that_are_too_large_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sections, "_MAX_PART_BYTES", 1 << 20)
    path = simulink.write_slx(tmp_path / "a.slx", {"simulink/blockdiagram.xml": bytes(3 << 20)})
    with pytest.raises(SpecError, match=r"blockdiagram\.xml has 3 MiB, more than 1"):
        read_diagram(path)


FIRST = '<ModelInformation><System Ref="system_0"/></ModelInformation>'


@pytest.mark.parametrize(
    ("limit", "message"),
    [("_MAX_SECTIONS", "more than 99 sections"), ("_MAX_REFERENCES", "more than 99 times")],
)
def test_parts_that_multiply_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, message: str
) -> None:
    monkeypatch.setattr(sections, limit, 99)
    twice = '<System><System Ref="system_{0}"/><System Ref="system_{0}"/></System>'
    parts = {f"simulink/systems/system_{i}.xml": twice.format(i + 1) for i in range(20)}
    parts |= {"simulink/blockdiagram.xml": FIRST, "simulink/systems/system_20.xml": "<System/>"}
    with pytest.raises(SpecError, match=message):
        read_diagram(simulink.write_slx(tmp_path / "a.slx", parts))


def test_systems_that_are_nested_too_deep_are_refused(tmp_path: Path) -> None:
    parts = {"simulink/blockdiagram.xml": FIRST}
    for i in range(150):
        within = f'<System Ref="system_{i + 1}"/>'
        parts[f"simulink/systems/system_{i}.xml"] = "<a>" * 50 + within + "</a>" * 50
    with pytest.raises(SpecError, match=r"a\.slx: its systems are nested too deep"):
        read_diagram(simulink.write_slx(tmp_path / "a.slx", parts))
