"""The public API as a user's type checker and editor see it."""

import subprocess
import sys

import pytest

import falsifier
from tests.command import ROOT

USER = ROOT / "tests" / "user_code.py"


def test_a_users_file_is_typed() -> None:
    """With the checkout's settings, which are strict, and its cache."""
    command = [sys.executable, "-m", "mypy", str(USER)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", falsifier.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(falsifier, name) is not None
    assert name in dir(falsifier)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'falsfy'"):
        falsifier.falsfy  # type: ignore[attr-defined]


def test_importing_is_cheap() -> None:
    code = "import time; t = time.process_time(); import falsifier; print(time.process_time() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(3)
    ]
    assert min(times) < 0.3
