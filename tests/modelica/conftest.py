"""Runs the exporter in its own environment; FMUs are built once a session, for this platform only."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.modelica.exporter import ROOT, exporter
from tests.patience import HANG

FEATURES = Path(__file__).parent / "Features"
Build = Callable[..., Path]


def exporter_python() -> str:
    """The Python of the exporter's environment."""
    default = ROOT / ".venv-export" / "bin" / "python"
    python = os.environ.get("FALSIFIER_EXPORT_PYTHON") or str(default)
    if not Path(python).exists():
        pytest.fail(
            f"the exporter's environment is missing: {python} does not exist. "
            "Create it with `make .venv-export/installed`, or name its Python in FALSIFIER_EXPORT_PYTHON."
        )
    return python


def run_exporter(*arguments: str, fresh: bool = False) -> subprocess.CompletedProcess[str]:
    """Run the exporter's command line, in a new interpreter or in one that has run before."""
    if not fresh:
        return exporter(exporter_python()).run(*arguments)
    command = [exporter_python(), str(ROOT / "modelica" / "export_fmu.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """Build a model of a Modelica package (default: the feature models), once a session."""
    folder = tmp_path_factory.mktemp("fmus")
    made: dict[tuple[str, int], Path] = {}

    def make(model: str, source: Path = FEATURES, fmi: int = 2) -> Path:
        name = model if "." in model else f"Features.{model}"
        key = (name, fmi)
        if key not in made:
            target = folder / f"{name}-{fmi}.fmu"
            options = ["--source", str(source), "--output", str(target), "--fmi", str(fmi)]
            done = run_exporter(name, *options, "--platform", "linux64")
            assert done.returncode == 0, done.stderr
            made[key] = target
        return made[key]

    return make
