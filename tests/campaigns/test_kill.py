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
from falsifier.record.journal import STOP
from falsifier.record.run import _STOP_PERIOD
from tests.campaigns.processes import WANTED
from tests.campaigns.support import outcomes, request, work_in_threads
from tests.command import listen_to_interrupts
from tests.patience import HANG, wait_until
from tests.problems import BEGUN, HOLD, RELEASE

ROOT = Path(__file__).resolve().parents[2]
KILLS = 2


class Held:
    """A campaign in a process of its own, which holds once so many simulations have begun."""

    def __init__(self, directory: Path, folder: Path, count: int, stderr: IO[bytes] | None = None) -> None:
        folder.mkdir()
        self.folder, self.count = folder, count
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.campaigns.processes", str(directory)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT), HOLD: f"{count} {folder}"},
            stderr=stderr,
            preexec_fn=listen_to_interrupts,
        )
        wait_until(lambda: self.begun() > count or self.process.poll() is not None)
        assert self.process.poll() is None, "the campaign has ended"

    def begun(self) -> int:
        """How many simulations have begun."""
        path = self.folder / BEGUN
        return path.stat().st_size if path.exists() else 0

    def release(self) -> None:
        """Let it go on."""
        (self.folder / RELEASE).touch()


def simulations(directory: Path) -> int:
    """How many simulations the campaign's journals hold."""
    return Follower(directory).look().spent.simulations


def test_killed_at_random_instants_it_ends_like_an_uninterrupted_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    work_in_threads(monkeypatch)
    run_campaign(WANTED, whole, jobs=2)
    rng, left = random.Random(4), simulations(whole)
    for kill in range(KILLS):
        campaign = Held(killed, tmp_path / f"hold{kill}", rng.randrange(1, left - 1))
        assert is_worked_on(killed)
        campaign.process.kill()
        assert campaign.process.wait() == -signal.SIGKILL
        left = simulations(whole) - simulations(killed)
    assert any(not run.finished for run in Follower(killed).look().runs)
    assert not is_worked_on(killed)
    resume_campaign(killed, jobs=2)
    assert outcomes(killed) == outcomes(whole)


@pytest.mark.skipif(sys.platform != "linux", reason="looks for children in /proc")
def test_a_killed_campaign_says_nothing_after_its_end(tmp_path: Path) -> None:
    said = tmp_path / "stderr"
    with said.open("wb") as stderr:
        process = Held(tmp_path / "c", tmp_path / "hold", 5, stderr).process
    helpers = children(process.pid)
    assert len(helpers) == 3  # two workers, and the one that frees what they share
    process.kill()
    process.wait()
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in helpers))
    assert said.read_text() == ""


def children(pid: int) -> list[int]:
    """Process ids of a process's children."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_run_that_kills_its_worker_has_failed(tmp_path: Path) -> None:
    (run,) = run_campaign(request("worker_killer", seeds=1), tmp_path).progress.runs
    assert run.status == "failed"
    assert "worker process died" in run.reason


def test_ctrl_c_stops_the_runs_where_they_are(tmp_path: Path) -> None:
    directory = tmp_path / "c"
    campaign = Held(directory, tmp_path / "hold", 5)
    campaign.process.send_signal(signal.SIGINT)
    wait_until((directory / STOP).exists)
    time.sleep(2 * _STOP_PERIOD)  # a run looks so often whether it should stop
    campaign.release()
    assert campaign.process.wait(timeout=HANG) == 0
    counts = Follower(directory).look().counts
    assert counts["interrupted"] > 0
    assert counts["running"] == 0
