from pathlib import Path

import pytest

from falsifier.campaigns.directory import (
    campaign_lock,
    is_worked_on,
    read_campaign,
    run_directories,
    run_directory,
    write_campaign,
)
from falsifier.errors import JournalError
from falsifier.record.run import falsify
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
