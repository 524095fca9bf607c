"""Reading and writing the record of a run."""

import errno
import fcntl
import json
import os
from contextlib import ExitStack
from pathlib import Path
from threading import Timer
from unittest.mock import Mock

import pytest

from falsifier.analyses.coverage import coverage
from falsifier.campaigns.analysis import load
from falsifier.core.files import seal
from falsifier.errors import JournalError, MachineError
from falsifier.record import journal
from falsifier.record.files import is_locked, recorded_trajectory, set_aside
from falsifier.record.records import Record, line_of
from falsifier.record.repair import repair
from falsifier.record.run import falsify
from falsifier.search.budget import Spent
from falsifier.search.result import Result
from falsifier.views.report.page import html_report
from tests.hostile.test_damage import Standing
from tests.patience import HANG
from tests.problems import impossible
from tests.record.test_summary import asked, confirmed, evaluated


def test_a_growing_journal_is_read_on_from_where_it_ended(tmp_path: Path) -> None:
    reader = journal.JournalReader(tmp_path)
    assert list(reader.new()) == []
    path = tmp_path / "journal.jsonl"
    found: list[Record] = [asked(0, 3), *(evaluated(i, float(i)) for i in range(3))]
    lines = [line_of(record, number) for number, record in enumerate(found, 1)]
    path.write_bytes(lines[0] + lines[1] + lines[2][:20])
    assert [r.line for r in reader.new()] == [1, 2]
    path.write_bytes(b"".join(lines))
    assert [r.line for r in reader.new()] == [3, 4]
    path.write_bytes(lines[0])
    assert reader.shrank


def test_a_journal_is_read_on_from_the_line_at_which_reading_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "journal.jsonl").write_bytes(line_of(asked(0, 1), 1))
    reader = journal.JournalReader(tmp_path)
    with monkeypatch.context() as stopped:
        stopped.setattr(journal, "parse_line", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            list(reader.new())
    assert [r.line for r in reader.new()] == [1]


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([evaluated(0, 0.0)], "line 1 .*: the candidates or simulations before .* are missing"),
        ([asked(0, 1), evaluated(0, 0.0), evaluated(0, 0.0)], "line 3 .* are missing"),
        ([asked(0, 2), evaluated(1, 0.0)], "line 2 .* are missing"),
        ([asked(1, 1)], "line 1 .* are missing"),
        ([asked(0, 1), confirmed(0, "confirmed", "", Spent())], "line 2 .*: simulation 0, which it confirms"),
        (
            [asked(0, 1), evaluated(0, 0.0), confirmed(-1, "confirmed", "", Spent())],
            "line 3 .*: simulation -1, which it confirms",
        ),
    ],
)
def test_a_journal_whose_records_do_not_follow_each_other_is_damaged(
    found: list[Record], said: str, tmp_path: Path
) -> None:
    lines = [line_of(record, number) for number, record in enumerate(found, 1)]
    (tmp_path / "journal.jsonl").write_bytes(b"".join(lines))
    with pytest.raises(JournalError, match=f"journal.jsonl: {said}"):
        journal.read_journal(tmp_path)


@pytest.mark.parametrize(
    ("old", "new"),
    [('"name": "u"', '"name": "v"'), ("NEVER", "OTHER")],
)
def test_a_run_whose_journal_names_other_things_than_its_manifest_is_damaged(
    old: str, new: str, tmp_path: Path
) -> None:
    falsify(impossible(), "corners", budget=2, directory=tmp_path)
    path = tmp_path / "manifest.json"
    stated = json.loads(path.read_text())
    del stated["sum"]
    path.write_text(seal(json.dumps(stated, indent=2).replace(old, new)))
    for read in (load, coverage, html_report):
        with pytest.raises(JournalError, match=r"are others than those in manifest\.json"):
            read(tmp_path)


def test_who_looks_whether_a_run_is_worked_on_does_not_keep_others_from_it(tmp_path: Path) -> None:
    (tmp_path / "lock").touch()
    looker = (tmp_path / "lock").open("rb")
    fcntl.flock(looker, fcntl.LOCK_SH)
    Timer(0.1, looker.close).start()
    with journal.open_journal(tmp_path):
        pass


def test_what_is_wrong_with_a_value_of_a_record_is_said_with_its_key(tmp_path: Path) -> None:
    for wrong, said in (
        ({"seconds": "x"}, r"asked\.seconds: expected a number, got 'x'"),
        (
            {"candidates": [{"signals": {"u": {"times": [0]}}}]},
            r"asked\.candidates, entry 1: signals\.u: expected times, values and inter",
        ),
    ):
        content = asked(0, 1).model_dump(exclude={"sum"}) | {"line": 1} | wrong
        (tmp_path / "journal.jsonl").write_text(seal(json.dumps(content)))
        with pytest.raises(JournalError, match=rf"journal\.jsonl: line 1 is damaged: {said}"):
            journal.read_journal(tmp_path)


def test_one_writer_per_directory(tmp_path: Path) -> None:
    busy = pytest.raises(JournalError, match="another process is writing")
    with journal.open_journal(tmp_path), busy, journal.open_journal(tmp_path):
        pass


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EACCES])
def test_where_there_are_no_locks_nobody_writes(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on Lustre, which clusters share: two that write to one run would damage it."""

    def refuse(*_: object) -> None:
        raise OSError(code, os.strerror(code))

    with journal.open_journal(tmp_path):
        assert is_locked(tmp_path / "lock")
    monkeypatch.setattr("fcntl.flock", refuse)
    without = pytest.raises(
        MachineError, match=r"lock cannot be locked \(.+\): choose a folder on a file system"
    )
    with without, journal.open_journal(tmp_path):
        pass
    assert is_locked(tmp_path / "lock") == (code == errno.EACCES), "what may not be read may be held"


def test_what_a_killed_run_has_left_half_written_is_removed_when_it_is_resumed(tmp_path: Path) -> None:
    dead = 2**22 + 7
    folder = tmp_path / "trajectories"
    folder.mkdir()
    left = [folder / f"3-0123456789abcdef.npz.{dead}.partial", tmp_path / f"manifest.json.{dead}.partial"]
    others = [folder / f"mine.npz.{dead}.partial", folder / "3-0123456789abcdef.npz.1.partial.txt"]
    for path in (*left, *others):
        path.touch()
    with journal.open_journal(tmp_path):
        pass
    assert not any(path.exists() for path in left)
    assert all(path.exists() for path in others)


def test_a_run_that_was_killed_before_its_manifest_was_complete_is_begun_again(tmp_path: Path) -> None:
    (tmp_path / f"manifest.json.{2**22 + 7}.partial").write_text("{")
    (tmp_path / "lock").touch()
    falsify(impossible(), "uniform", budget=1, directory=tmp_path)
    assert not list(tmp_path.glob("*.partial"))


def test_what_users_call_partial_is_kept(tmp_path: Path) -> None:
    (tmp_path / "film.mp4.partial").write_text("half")
    with pytest.raises(JournalError, match="has files, which are kept"):
        falsify(impossible(), "uniform", budget=1, directory=tmp_path)


def test_a_lock_is_waited_for_as_long_as_patience_lasts(tmp_path: Path) -> None:
    first = ExitStack()
    first.enter_context(journal.run_lock(tmp_path))
    Timer(0.2, first.close).start()
    with journal.run_lock(tmp_path, patience=HANG):
        pass


@pytest.mark.parametrize("damage", ["changed", "missing"])
def test_a_trajectory_that_is_damaged_is_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    falsify(impossible(), "uniform", budget=1, directory=tmp_path)
    (first,) = sorted((tmp_path / "trajectories").iterdir())
    if damage == "missing":
        first.unlink()
    else:
        first.write_bytes(first.read_bytes()[:-1] + b"?")
    for _ in range(2):
        assert recorded_trajectory(tmp_path, f"trajectories/{first.name}") is None
    assert caplog.text.count(f"{first.name} is damaged") == 1
    assert "not shown: its file is damaged or missing" in html_report(tmp_path)


def test_a_run_that_is_being_written_is_left_alone(tmp_path: Path) -> None:
    Standing().run(tmp_path)
    with journal.open_journal(tmp_path), pytest.raises(JournalError, match="another process is writing"):
        repair(tmp_path)


def test_what_is_set_aside_replaces_nothing(tmp_path: Path) -> None:
    for number in (1, 2):
        (tmp_path / "a").write_text(str(number))
        assert set_aside(tmp_path / "a").name == f"a.damaged-{number}"
    assert (tmp_path / "a.damaged-1").read_text() == "1"


def test_trajectories_that_a_better_one_has_replaced_are_not_told_as_damaged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    falsify(impossible(), "uniform", budget=20, directory=tmp_path)
    kept = sorted((tmp_path / "trajectories").iterdir(), key=lambda path: int(path.name.partition("-")[0]))
    for path in kept[:-1]:
        path.unlink()
    (tmp_path / "trajectories" / "mine.npz").touch()
    assert recorded_trajectory(tmp_path, f"trajectories/{kept[0].name}") is None
    assert "is damaged" not in caplog.text


@pytest.mark.parametrize(("slow", "most", "kept"), [(0.0, 10**9, 20), (60.0, 10**9, 2), (0.0, 1, 0)])
def test_trajectories_that_took_long_are_kept_as_long_as_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slow: float, most: int, kept: int
) -> None:
    monkeypatch.setattr(journal, "_KEPT_TRAJECTORIES", 2)
    monkeypatch.setattr(journal, "_SLOW", slow)
    monkeypatch.setattr(journal, "_KEPT_BYTES", most)
    result = falsify(impossible(), "uniform", budget=20, directory=tmp_path)
    assert isinstance(result, Result)
    found = {int(path.name.partition("-")[0]) for path in (tmp_path / "trajectories").iterdir()}
    values = [e.robustness or 0.0 for e in result.evaluations]
    assert found == {i for i in range(20) if i < kept or values[i] < min(values[:i], default=9.0)}
