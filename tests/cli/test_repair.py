from pathlib import Path

import pytest
from click.testing import CliRunner

from falsifier.campaigns.analysis import load as load_runs
from falsifier.cli import cli
from falsifier.errors import JournalError
from falsifier.record.journal import read_journal
from tests.hostile.test_damage import Numeric


def test_one_damaged_line_costs_one_simulation(tmp_path: Path) -> None:
    Numeric().run(tmp_path)
    path = tmp_path / "journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[3] = lines[3].replace(b'"status":"ok"', b'"status":"OK"')
    path.write_bytes(b"".join(lines))
    with pytest.raises(JournalError, match=r"line 4 is damaged: its checksum .* falsifier tools repair"):
        read_journal(tmp_path)
    done = CliRunner().invoke(cli, ["tools", "repair", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "line 4: its checksum does not match" in done.output
    assert (tmp_path / "journal.jsonl.damaged-1").read_bytes() == b"".join(lines)
    kept = [r.index for r in read_journal(tmp_path) if r.kind == "evaluated"]
    assert 1 not in kept and len(kept) == len(load_runs(tmp_path)[0].robustness) - 1
    before = len(read_journal(tmp_path))
    assert Numeric().resume(tmp_path).falsified
    assert [r.kind for r in read_journal(tmp_path)[before:]] == ["evaluated", "ended"]
    assert CliRunner().invoke(cli, ["tools", "repair", str(tmp_path)]).output.endswith("nothing is damaged\n")
