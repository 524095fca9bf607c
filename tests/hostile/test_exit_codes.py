"""What the search found decides the exit code; failures afterwards are messages."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from falsifier.campaigns.analysis import load
from falsifier.cli import run as command
from falsifier.record.journal import Journal
from falsifier.record.run import falsify
from falsifier.search.events import Confirmed, Event, RunEnded
from tests.command import ROOT
from tests.problems import easy

FALSIFIED = ("run", "python:tests.problems:easy", "--engine", "corners", "--quiet")
STANDS = ("run", "python:tests.problems:impossible", "--engine", "corners", "--budget", "3", "--quiet")


def started(*arguments: str, shell: str, cwd: Path, before: Callable[[], None] | None = None) -> int:
    """Run the command line through a shell that sets up its streams; return the exit code."""
    script = f'exec "$0" -c "from falsifier.cli import main; main()" "$@" {shell}'
    return subprocess.run(
        ["sh", "-c", script, sys.executable, *arguments],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=120,
        check=False,
        preexec_fn=before,
    ).returncode


@pytest.mark.parametrize(
    ("shell", "arguments", "code"),
    [
        ("2>/dev/full", FALSIFIED, 1),
        (">/dev/full 2>&1", FALSIFIED, 1),
        ("<&- >&- 2>&-", FALSIFIED, 1),
        (">/dev/full", STANDS, 0),
        (">/dev/full 2>&1", ("run", "no-such-problem"), 2),
        ("2>&-", ("run", "--no-such-option"), 2),
    ],
)
def test_full_and_closed_streams_leave_the_code(
    shell: str, arguments: tuple[str, ...], code: int, tmp_path: Path
) -> None:
    assert started(*arguments, "--out", "run", shell=shell, cwd=tmp_path) == code
    if code < 2:
        assert load(tmp_path / "run")[0].falsified == (code == 1)  # nothing printed landed in its files


def test_a_disk_that_is_full_from_the_start_is_a_failure_of_the_machine(tmp_path: Path) -> None:
    def full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    assert started(*FALSIFIED, "--out", "run", shell="", cwd=tmp_path, before=full) == 3


def test_a_picture_that_cannot_be_drawn_is_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("no font")

    monkeypatch.setattr("falsifier.views.plotting.plot_evaluation", fail)
    results = [falsify(easy(), "corners", directory=tmp_path / "run")]
    with pytest.raises(SystemExit) as end:
        command._finish(results, as_json=False)
    assert end.value.code == 1
    assert "cannot be drawn: no font" in capsys.readouterr().err
    assert (tmp_path / "run" / "counterexample.json").is_file()


@pytest.mark.parametrize("last", [Confirmed, RunEnded])
def test_a_search_that_can_no_longer_be_recorded_has_found_what_it_found(
    last: type[Event], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = Journal.__call__

    def until_full(journal: Journal, event: Event) -> None:
        if isinstance(event, last):
            raise OSError(28, "No space left on device")
        record(journal, event)

    monkeypatch.setattr(Journal, "__call__", until_full)
    result = falsify(easy(), "corners", directory=tmp_path / "run")
    assert result.falsified
    assert "No space left" in result.unrecorded
    with pytest.raises(SystemExit) as end:
        command._finish([result], as_json=False)
    assert end.value.code == 1
    assert "could not be recorded" in capsys.readouterr().err
