from pathlib import Path

import pytest

from falsifier.errors import JournalError
from falsifier.record.journal import open_journal, read_journal, repair, set_aside
from falsifier.record.run import falsify, resume
from tests.hostile.test_damage import Led, Standing, outcome
from tests.problems import easy


def test_what_stands_before_the_damage_is_kept(tmp_path: Path) -> None:
    wanted = outcome(Led().run(tmp_path))
    path = tmp_path / "journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    third = [i for i, line in enumerate(lines) if b'"kind":"exchange"' in line][2]
    lines[third] = lines[third].replace(b"rationale", b"Rationale", 1)
    path.write_bytes(b"".join(lines))
    (said,) = repair(tmp_path)
    assert f"line {third + 1} is damaged" in said and "falsifier resume" in said
    assert [r.kind for r in read_journal(tmp_path)] == ["exchange", "asked", "evaluated"] * 2
    assert outcome(Led().resume(tmp_path)) == wanted


def test_a_run_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    Standing().run(tmp_path)
    with open_journal(tmp_path), pytest.raises(JournalError, match="another process is writing"):
        repair(tmp_path)


def test_what_is_set_aside_replaces_nothing(tmp_path: Path) -> None:
    for number in (1, 2):
        (tmp_path / "a").write_text(str(number))
        assert set_aside(tmp_path / "a").name == f"a.damaged-{number}"
    assert (tmp_path / "a.damaged-1").read_text() == "1"


def test_a_journal_that_is_a_folder_is_set_aside(tmp_path: Path) -> None:
    falsify(easy(), "corners", budget=2, directory=tmp_path)
    journal = tmp_path / "journal.jsonl"
    journal.unlink()
    journal.mkdir()
    with pytest.raises(JournalError, match="not a journal; to set it aside: falsifier tools repair"):
        resume(tmp_path, problems=[easy()])
    (finding,) = repair(tmp_path)
    assert "kept as journal.jsonl.damaged-1" in finding
    (result,) = resume(tmp_path, problems=[easy()])
    assert result.spent.simulations > 0
