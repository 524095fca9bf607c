"""Campaigns with real worker processes, killed without warning."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import pytest

from falsifier.campaigns import Follower, is_worked_on, resume_campaign, run_campaign
from falsifier.campaigns.directory import is_campaign
from tests.campaigns.processes import WANTED
from tests.campaigns.support import outcomes, request, work_in_threads
from tests.command import listen_to_interrupts

ROOT = Path(__file__).resolve().parents[2]
KILLS = 2


def start(directory: Path, stderr: IO[bytes] | None = None) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", "tests.campaigns.processes", str(directory)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stderr=stderr, preexec_fn=listen_to_interrupts
    )


def simulations(directory: Path) -> int:
    """How many simulations the campaign's journals hold."""
    return Follower(directory).look().spent.simulations if is_campaign(directory) else 0


def test_killed_at_random_instants_it_ends_like_an_uninterrupted_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    work_in_threads(monkeypatch)
    run_campaign(WANTED, whole, jobs=2)
    for instant in sorted(random.Random(4).sample(range(1, simulations(whole)), KILLS)):
        process = start(killed)
        deadline = time.monotonic() + 60
        while simulations(killed) < instant and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        assert is_worked_on(killed)
        process.kill()
        assert process.wait() == -signal.SIGKILL, "the campaign ended before it could be killed"
    assert any(not run.finished for run in Follower(killed).look().runs)
    assert not is_worked_on(killed)
    resume_campaign(killed, jobs=2)
    assert outcomes(killed) == outcomes(whole)


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
def test_a_killed_campaign_says_nothing_after_its_end(tmp_path: Path) -> None:
    said = tmp_path / "stderr"
    with said.open("wb") as stderr:
        process = start(tmp_path / "c", stderr)
    deadline = time.monotonic() + 60
    while simulations(tmp_path / "c") < 5 and time.monotonic() < deadline:
        time.sleep(0.02)
    helpers = children(process.pid)
    assert len(helpers) == 3  # two workers, and the one that frees what they share
    process.kill()
    process.wait()
    while any(Path(f"/proc/{pid}").exists() for pid in helpers) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert said.read_text() == ""


def children(pid: int) -> list[int]:
    """Process ids of a process's children."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_run_that_kills_its_worker_has_failed(tmp_path: Path) -> None:
    outcome = run_campaign(request("worker_killer", seeds=1), tmp_path)
    (run,) = outcome.progress.runs
    assert run.status == "failed"
    assert "worker process died" in run.reason


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_ctrl_c_stops_the_runs_where_they_are(tmp_path: Path) -> None:
    directory = tmp_path / "c"
    process = start(directory)
    deadline = time.monotonic() + 60
    while simulations(directory) < 5 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 0
    counts = Follower(directory).look().counts
    assert counts["interrupted"] > 0
    assert counts["running"] == 0
