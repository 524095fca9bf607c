from pathlib import Path

import pytest
from click.testing import CliRunner

from falsifier.campaigns.analysis import load as load_runs
from falsifier.cli import cli
from falsifier.errors import JournalError
from falsifier.record.journal import read_journal
from tests.hostile.test_damage import Numeric


def test_a_damaged_line_is_told_with_its_cure_and_the_run_goes_on_from_there(tmp_path: Path) -> None:
    Numeric().run(tmp_path)
    path = tmp_path / "journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[3] = lines[3].replace(b'"status":"ok"', b'"status":"OK"')
    path.write_bytes(b"".join(lines))
    with pytest.raises(JournalError, match=r"line 4 is damaged: its checksum .* falsifier tools repair"):
        read_journal(tmp_path)
    done = CliRunner().invoke(cli, ["tools", "repair", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "line 4 is damaged" in done.output
    assert (tmp_path / "journal.jsonl.damaged-1").read_bytes() == b"".join(lines)
    assert len(read_journal(tmp_path)) == 3
    assert Numeric().resume(tmp_path).falsified
    assert len(load_runs(tmp_path)[0].robustness) > 3
    assert CliRunner().invoke(cli, ["tools", "repair", str(tmp_path)]).output.endswith("nothing is damaged\n")
