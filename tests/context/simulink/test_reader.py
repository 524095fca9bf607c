from pathlib import Path

import pytest

from falsifier.context.simulink.diagram import End, Wire
from falsifier.context.simulink.reader import read_diagram
from falsifier.errors import SpecError
from tests.fixtures import simulink


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
    assert blocks["Safety switch"].parameter("OnSwitchValue") == "64"
    assert blocks["Counter"].reference == "simulink/Sources/Counter Limited"
    assert blocks["Mode logic"].is_chart
    assert root.wires[0] == Wire(End("disagreement", "1"), (End("Mode logic", "1"),), "difference")
    assert {end.block for end in root.wires[5].targets} == {"temperature", "Safety switch", "Controller"}
    controller = blocks["Controller"].system
    assert controller is not None
    inner = {block.name: block for block in controller.blocks}
    assert inner["Limited"].parameter("Threshold") == "0"  # of all switches
    assert inner["Integral"].parameter("UpperSaturationLimit") == "100"
    assert inner["Scope"].is_off
    assert End("Integral", "enable") in {end for wire in controller.wires for end in wire.targets}


def test_what_is_no_model_is_an_error(tmp_path: Path) -> None:
    for text, message in (
        ("Stateflow {\n}\n", "expected a model or library, found Stateflow"),
        ("", "found nothing"),
        ("Model {\n}\n", "has no system of blocks"),
        ("Model {\nSystem {\nBlock {\nBlockType Gain\n}\n}\n}\n", "a block of the model has no name"),
        ('Model {\nSystem {\nBlock {\nName "a"\n}\n}\n}\n', "has no type"),
        ('Model {\nSystem {\nLine {\nSrcBlock "a"\n}\n}\n}\n', "ends at 'a', which is no block there"),
        ("MATLAB\0\0", "found binary data"),
    ):
        path = tmp_path / "a.mdl"
        path.write_text(text)
        with pytest.raises(SpecError, match=message):
            read_diagram(path)
    with pytest.raises(SpecError, match="cannot be read"):
        read_diagram(tmp_path / "none.mdl")


def test_libraries_and_referenced_models_are_named(tmp_path: Path) -> None:
    path = tmp_path / "lib.mdl"
    path.write_text(
        'Library {\nName "lib"\nSystem {\nBlock {\nBlockType ModelReference\nName "plant"\n'
        'ModelNameDialog "plant.slx"\n}\n}\n}\n'
    )
    diagram = read_diagram(path)
    assert diagram.is_library
    assert diagram.root.blocks[0].reference == "plant.slx"


def test_systems_that_are_nested_too_deep_are_refused(tmp_path: Path) -> None:
    parts = {"simulink/blockdiagram.xml": '<ModelInformation><System Ref="system_0"/></ModelInformation>'}
    for i in range(150):
        within = f'<System Ref="system_{i + 1}"/>'
        parts[f"simulink/systems/system_{i}.xml"] = "<a>" * 50 + within + "</a>" * 50
    with pytest.raises(SpecError, match=r"a\.slx: its systems are nested too deep"):
        read_diagram(simulink.write_slx(tmp_path / "a.slx", parts))
