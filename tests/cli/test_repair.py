from pathlib import Path
from typing import Any

import pytest

from falsifier.campaigns.analysis import load as load_runs
from falsifier.counterexamples.store import load_counterexample
from falsifier.errors import JournalError, SpecError
from falsifier.record.journal import read_journal, simulated
from tests.hostile.test_damage import Numeric, Standing


def test_a_damaged_line_is_told_with_its_cure_and_the_run_goes_on(command: Any, tmp_path: Path) -> None:
    Numeric().run(tmp_path)
    path = tmp_path / "journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[3] = lines[3].replace(b'"status":"ok"', b'"status":"OK"')
    path.write_bytes(b"".join(lines))
    with pytest.raises(JournalError, match=r"line 4 is damaged: its checksum .* falsifier tools repair"):
        read_journal(tmp_path)
    assert "line 4 is damaged" in command("tools", "repair", str(tmp_path), code=0).output
    assert (tmp_path / "journal.jsonl.damaged-1").read_bytes() == b"".join(lines)
    assert len(read_journal(tmp_path)) == 3
    assert Numeric().resume(tmp_path).falsified
    assert len(load_runs(tmp_path)[0].robustness) > 3
    for name, maker in (("counterexample.json", "replay"), ("shrunk.json", "explain --shrink")):
        (tmp_path / name).write_text("{}")
        with pytest.raises(SpecError, match=r"damaged; to write it again: falsifier tools repair"):
            load_counterexample(tmp_path / name)
        done = command("tools", "repair", str(tmp_path))
        assert done.output.endswith(f"falsifier {maker} writes it again\nrepaired\n")
    again = command("tools", "repair", str(tmp_path)).output
    assert f"nothing is damaged; {simulated(tmp_path)} simulations recorded" in again


@pytest.mark.parametrize("kept", [0, 2])
def test_lines_of_another_run_are_refused_and_dropped(command: Any, tmp_path: Path, kept: int) -> None:
    mine, other = tmp_path / "mine" / "journal.jsonl", tmp_path / "other" / "journal.jsonl"
    wanted = Numeric().run(mine.parent)
    Numeric().run(other.parent)
    lines = mine.read_bytes().splitlines(keepends=True)[:kept]
    lines += other.read_bytes().splitlines(keepends=True)[kept:]
    mine.write_bytes(b"".join(lines))
    first = f"journal.jsonl: line {kept + 1} is damaged: it was written by another run"
    for name in ("report", "watch", "coverage", "explain"):
        done = command(name, "mine")
        assert isinstance(done.exception, JournalError) and first in str(done.exception), name
    with pytest.raises(JournalError, match=first):
        Numeric().resume(mine.parent)
    done = command("tools", "repair", "mine")
    assert first in done.output and f"{len(lines) - kept} lines from there on dropped" in done.output
    assert Numeric().resume(mine.parent).robustness == wanted.robustness


@pytest.mark.parametrize("kept", [None, 0, 60])
def test_a_journal_without_a_simulation_is_called_so(command: Any, tmp_path: Path, kept: int | None) -> None:
    Standing().run(tmp_path / "run")
    journal = tmp_path / "run" / "journal.jsonl"
    content = journal.read_bytes()
    journal.unlink()
    if kept is not None:
        journal.write_bytes(content[:kept])
    assert command("tools", "repair", "run").output == "run: the journal contains no simulation\n"
    said = str(command("explain", "run").exception)
    assert "contains no simulation; to simulate: falsifier resume run" in said
