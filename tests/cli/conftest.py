from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from falsifier.cli import cli
from tests.campaigns.support import work_in_threads


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Call a command in this process, with threads for workers."""
    work_in_threads(monkeypatch)
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        return CliRunner().invoke(cli, [str(a) for a in arguments])

    return call
