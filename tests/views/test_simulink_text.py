import json
from pathlib import Path

from falsifier.context.simulink import read_diagram
from falsifier.views.simulink_text import simulink_json, simulink_text
from tests.fixtures import simulink


def test_text_begins_with_the_size_and_json_has_everything(tmp_path: Path) -> None:
    diagram = read_diagram(simulink.write_slx(tmp_path / "limphome.slx"))
    assert simulink_text(diagram).startswith("21 blocks in 2 systems, 1 chart\nModel limphome")
    found = json.loads(simulink_json(diagram))
    assert found["root"]["blocks"][0]["name"] == "disagreement"
    assert found["charts"][0]["states"][0]["name"] == "Normal"
