"""Machines that lack what a search needs: one clear line, and the exit code of a machine that failed.

What was found decides the exit code; failures afterwards are messages.
"""

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from falsifier.campaigns.analysis import load
from falsifier.cli import run as command
from falsifier.record.journal import Journal
from falsifier.record.run import falsify, resume
from falsifier.search.events import Confirmed, Evaluated, Event, RunEnded
from tests.command import ROOT
from tests.problems import easy, impossible

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")

FMU = ROOT / "tests" / "fixtures" / "fmus" / "Lag_2.fmu"
RUN = [
    *("run", str(FMU), "--search", "u=0:1", "--interface", "co-simulation", "--stop-time", "1", "--quiet"),
    *("--stl", "G[0,1] (x <= 2)", "--output-interval", "0.1", "--engine", "corners", "--budget", "2"),
]
FALSIFIED = ["run", "python:tests.problems:easy", "--engine", "corners", "--quiet"]
STANDS = ["run", "python:tests.problems:impossible", "--engine", "corners", "--budget", "3", "--quiet"]


def limited(number: int, most: int) -> Callable[[], None]:
    """Before a process starts: limit what it may use."""
    return lambda: resource.setrlimit(number, (most, most))


def run(
    folder: Path,
    arguments: Sequence[str] = RUN,
    *,
    shell: str = "",
    before: Callable[[], None] | None = None,
    **environment: str,
) -> tuple[int, str]:
    """Search in another process, whose streams a shell sets up; return its exit code and its messages."""
    script = f'exec "$0" -c "from falsifier.cli import main; main()" "$@" --out run {shell}'
    done = subprocess.run(
        ["sh", "-c", script, sys.executable, *arguments],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        preexec_fn=before,
    )
    assert "Traceback" not in done.stderr and "defect" not in done.stderr
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("number", "most", "says"),
    [
        (resource.RLIMIT_DATA, 200 << 20, "ulimit -d 307200"),
        (resource.RLIMIT_DATA, 40 << 20, "ulimit -d 307200"),
        (resource.RLIMIT_AS, 400 << 20, "ulimit -v 512000"),
        (resource.RLIMIT_NOFILE, 14, "Too many open files; raise the limit on open files (ulimit -n)"),
    ],
)
def test_too_low_limits_are_said_at_once(number: int, most: int, says: str, tmp_path: Path) -> None:
    code, said = run(tmp_path, before=limited(number, most))
    assert code == 3
    assert says in said and said.count("\n") == 1


@pytest.mark.parametrize(("shell", "tmpdir"), [("2>&-", "."), ("<&- >&- 2>&-", "none")])
def test_simulations_need_no_streams_and_take_any_tmpdir(shell: str, tmpdir: str, tmp_path: Path) -> None:
    assert run(tmp_path, shell=shell, TMPDIR=tmpdir)[0] == 0


def test_where_no_temporary_file_can_be_written_another_folder_is_asked_for(tmp_path: Path) -> None:
    """As in a container whose files may only be read."""
    code, said = run(tmp_path, ["simulate", "AT1"], before=limited(resource.RLIMIT_FSIZE, 0))
    assert (code, said.endswith("; set TMPDIR to a folder that can be written to\n")) == (3, True)


def test_a_current_folder_that_was_deleted_is_told(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    code, said = run(tmp_path / "gone", ["run", "AT1"], before=(tmp_path / "gone").rmdir)
    assert (code, "if the current folder was deleted, change to another" in said) == (3, True)


@pytest.mark.parametrize(
    ("shell", "arguments", "code"),
    [
        ("2>/dev/full", FALSIFIED, 1),
        (">/dev/full 2>&1", FALSIFIED, 1),
        ("<&- >&- 2>&-", FALSIFIED, 1),
        (">/dev/full", STANDS, 0),
        (">/dev/full 2>&1", ["run", "no-such-problem"], 2),
        ("2>&-", ["run", "--no-such-option"], 2),
    ],
)
def test_full_and_closed_streams_leave_the_code(
    shell: str, arguments: list[str], code: int, tmp_path: Path
) -> None:
    found, said = run(tmp_path, arguments, shell=shell)
    assert found == code
    assert shell != ">/dev/full" or "the result cannot be printed: No space left" in said
    if code < 2:
        assert load(tmp_path / "run")[0].falsified == (code == 1)  # nothing printed landed in its files


@pytest.mark.parametrize(
    ("most", "where"),
    [
        (0, "run/manifest.json"),
        (500, "run/manifest.json"),
        (10_000, "Lag_2.fmu is unpacked"),
        (200_000, "memory shared with the processes of FMUs"),
    ],
)
def test_a_limit_on_the_size_of_files_is_told_with_the_file_and_the_cure(
    most: int, where: str, tmp_path: Path
) -> None:
    code, said = run(tmp_path, before=limited(resource.RLIMIT_FSIZE, most), PYTHONDONTWRITEBYTECODE="1")
    assert code == 3
    assert f"{where}: File too large" in said and said.count("\n") == 1
    assert "ulimit -f" in said and "free" not in said


def test_a_picture_that_cannot_be_drawn_is_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("no font")

    monkeypatch.setattr("falsifier.views.plotting.plot_evaluation", fail)
    results = [falsify(easy(), "corners", directory=tmp_path / "run")]
    with pytest.raises(SystemExit, match=r"^1$"):
        command._finish(results, as_json=False)
    assert "cannot be drawn: no font" in capsys.readouterr().err
    assert (tmp_path / "run" / "counterexample.json").is_file()


@pytest.mark.parametrize("moved", [False, True])
def test_a_search_that_cannot_be_recorded_any_more_shows_its_best(
    moved: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = Journal.__call__
    place = tmp_path / "run"

    def until(journal: Journal, event: Event) -> None:
        if isinstance(event, Evaluated) and event.index == 2:
            if moved:
                journal.directory.rename(tmp_path / "moved")
            else:
                raise OSError(28, "No space left on device", f"{place}/journal.jsonl")
        record(journal, event)

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "__call__", until)
        (result,) = falsify([impossible()], "corners", directory=place, budget=5)
    assert result.best is not None and len(result.evaluations) == 3
    with pytest.raises(SystemExit, match=r"^3$"):
        command._finish([result], as_json=False)
    told = capsys.readouterr().out
    assert f"failed: the run cannot be recorded: {place}/" in told
    assert (f"to continue: falsifier resume {place}" in told) == place.exists() == (not moved)
    assert (f"{place} was moved or deleted; if it was moved, to continue: falsifier resume " in told) == moved
    (resumed,) = resume(tmp_path / "moved" if moved else place, problems=[impossible()])
    assert resumed.status == "not falsified" and len(resumed.evaluations) == 5


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
    assert "No space left on device; free some space" in result.unrecorded
    with pytest.raises(SystemExit, match=r"^1$"):
        command._finish([result], as_json=False)
    assert "could not be recorded" in capsys.readouterr().err
