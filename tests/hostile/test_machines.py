"""Machines that lack what a search needs: one clear line, and the exit code of a machine that failed."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command import ROOT

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")

FMU = ROOT / "tests" / "fixtures" / "fmus" / "Lag_2.fmu"
RUN = [
    *("run", str(FMU), "--search", "u=0:1", "--interface", "co-simulation", "--stop-time", "1", "--quiet"),
    *(
        "--stl",
        "G[0,1] (x <= 2)",
        "--output-interval",
        "0.1",
        "--engine",
        "corners",
        "--budget",
        "2",
        "--quiet",
    ),
]


def limited(number: int, most: int) -> Callable[[], None]:
    """Before a process starts: limit what it may use."""
    return lambda: resource.setrlimit(number, (most, most))


def run(
    folder: Path, *, before: Callable[[], None] | None = None, out: str = "run", **environment: str
) -> tuple[int, str]:
    """Search in another process; return its exit code and its messages."""
    done = subprocess.run(
        [sys.executable, "-c", "from falsifier.cli import main; main()", *RUN, "--out", out],
        cwd=folder,
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
    ],
)
def test_too_little_memory_is_said_at_once(number: int, most: int, says: str, tmp_path: Path) -> None:
    code, said = run(tmp_path, before=limited(number, most))
    assert code == 3
    assert says in said and said.count("\n") == 1


@pytest.mark.parametrize("closed", [(2,), (0, 1, 2)])
def test_simulations_need_no_open_streams_and_no_folder_for_temporary_files(
    closed: tuple[int, ...], tmp_path: Path
) -> None:
    def close() -> None:
        for stream in closed:
            os.close(stream)

    assert run(tmp_path, before=close, TMPDIR=str(tmp_path / "none"))[0] == 0


@pytest.mark.parametrize(
    ("most", "where"),
    [
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
