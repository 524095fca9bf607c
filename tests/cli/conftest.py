from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from falsifier.cli import cli
from tests.campaigns.support import work_in_threads


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Call a command in this process, with threads for workers; ``code`` is what it must end with."""
    work_in_threads(monkeypatch)
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str, code: int | None = None) -> Result:
        ended = CliRunner().invoke(cli, [str(a) for a in arguments])
        assert code in (None, ended.exit_code), f"{ended.output} {ended.exception}"
        return ended

    return call
