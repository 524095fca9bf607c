from pathlib import Path
from shutil import copytree

import pytest

from falsifier.campaigns.directory import (
    campaign_lock,
    is_worked_on,
    read_campaign,
    run_directories,
    run_directory,
    write_campaign,
)
from falsifier.campaigns.runs import load
from falsifier.errors import JournalError
from falsifier.record.run import falsify, resume
from falsifier.testing import lag_problem
from falsifier.views.report.watch import Watch
from tests.problems import impossible


def test_only_runs_that_have_begun_are_listed(campaign: Path, tmp_path: Path) -> None:
    record = read_campaign(campaign)
    write_campaign(tmp_path, record)
    assert run_directories(tmp_path) == []
    second = list(record.request.named())[1]
    place = run_directory(tmp_path, second)
    place.mkdir(parents=True)
    (place / "manifest.json").write_bytes((run_directory(campaign, second) / "manifest.json").read_bytes())
    assert run_directories(tmp_path) == [place]


def test_a_run_is_its_own_only_one_and_a_folder_has_those_in_it(tmp_path: Path) -> None:
    for name in ("b", "a"):
        falsify(impossible(), "uniform", budget=1, directory=tmp_path / name)
    (tmp_path / "notes").mkdir()
    assert run_directories(tmp_path / "a") == [tmp_path / "a"]
    assert run_directories(tmp_path) == [tmp_path / "a", tmp_path / "b"]
    with pytest.raises(JournalError, match="notes"):
        run_directories(tmp_path / "notes")


def test_runs_without_a_manifest_are_left_out_and_told(
    campaign: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("a", "b", "starts"):
        falsify(impossible(), "uniform", budget=1, directory=tmp_path / name)
    (tmp_path / "b" / "manifest.json").unlink()
    (tmp_path / "starts" / "manifest.json").unlink()
    (tmp_path / "starts" / "journal.jsonl").write_text("")
    assert [run.directory for _ in range(2) for run in load(tmp_path)] == 2 * [tmp_path / "a"]
    why = "is left out: it has a journal, but no manifest.json, which says what was searched"
    assert caplog.messages == [f"{tmp_path / 'b'} {why}; put that file back"]
    copy = copytree(campaign, tmp_path / "campaign")
    first, *others = run_directories(copy)
    (first / "manifest.json").unlink()
    assert run_directories(copy) == others
    cure = f"falsifier tools repair {copy} lets the campaign repeat it"
    assert caplog.messages[1:] == [f"{first} {why}; {cure}"]


def test_runs_of_a_spec_that_is_searched_in_groups_are_found_a_folder_deeper(tmp_path: Path) -> None:
    problems = [impossible(), lag_problem("G[0,5] (x <= 50)", points=2, name="APART")]
    for seed in (1, 0):
        falsify(problems, "uniform", budget=1, seed=seed, directory=tmp_path / f"{seed}")
    falsify(impossible(), "uniform", budget=1, directory=tmp_path / "one")
    names = ["0/APART", "0/NEVER", "1/APART", "1/NEVER", "one"]
    assert run_directories(tmp_path) == [tmp_path / name for name in names]
    assert [run.requirement for run in load(tmp_path)] == ["APART", "NEVER", "APART", "NEVER", "NEVER"]
    assert len(resume(tmp_path, problems=problems, budget=2)) == len(names)
    page, _ = Watch(tmp_path).look("1/NEVER")
    assert "1/NEVER: not running." in page and all(f"?run={name}" in page for name in names)


def test_a_lock_that_may_only_be_read_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    directory, refused = tmp_path / "c", PermissionError("read-only")
    with campaign_lock(directory):
        pass

    def refuse(*_: object, **__: object) -> None:
        raise refused

    with campaign_lock(directory):
        monkeypatch.setattr("falsifier.record.files.locked", refuse)
        assert is_worked_on(directory)
    assert not is_worked_on(directory)
