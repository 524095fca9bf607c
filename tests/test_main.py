"""``python -m falsifier`` is the command line."""

import subprocess
import sys

import falsifier
from tests.command import ROOT


def test_the_package_is_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "falsifier", "--version"],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert falsifier.__version__ in done.stdout
