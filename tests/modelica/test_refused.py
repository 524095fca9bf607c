"""What the exporter does not support is an error that names file and line, never a wrong FMU.

Every model in `refused/` has a comment `// error: ...` with a part of the message on the line that the error
must name.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.modelica.conftest import ROOT, exporter_python, run_exporter
from tests.patience import HANG

FOLDER = Path(__file__).parent / "refused"
CASES = sorted(path.stem for path in FOLDER.glob("*.mo"))

PROGRAM = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from export.cli import translate
from export.read.syntax import ExportError
found = {}
for path in sorted(Path(sys.argv[2]).glob("*.mo")):
    try:
        translate(path, "M")
        found[path.stem] = "translated"
    except ExportError as error:
        found[path.stem] = str(error)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def messages() -> dict[str, str]:
    """The exporter's message for every model, from one process."""
    command = [exporter_python(), "-c", PROGRAM, str(ROOT / "modelica"), str(FOLDER)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", CASES)
def test_refused_with_file_and_line(messages: dict[str, str], name: str) -> None:
    lines = (FOLDER / f"{name}.mo").read_text().splitlines()
    [(number, part)] = [
        (k, line.split("// error: ")[1]) for k, line in enumerate(lines, 1) if "// error: " in line
    ]
    assert messages[name].startswith(f"{name}.mo:{number}: ")
    assert part in messages[name]


def test_a_missing_file_and_a_missing_model_are_named(tmp_path: Path) -> None:
    done = run_exporter("M", "--source", str(tmp_path / "none.mo"))
    assert done.returncode == 1
    assert "none.mo does not exist" in done.stderr
    done = run_exporter("Nothing")
    assert done.returncode == 1
    assert "there is no model 'Nothing'" in done.stderr
