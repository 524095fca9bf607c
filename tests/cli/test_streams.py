"""Ctrl-C and streams, in a process of their own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import ROOT, listen_to_interrupts

# A command that takes the first Ctrl-C badly: it goes on for a minute.
STUBBORN = """
import sys, time
from falsifier.cli import streams

streams.stop_at_interrupts()
try:
    print("ready", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("stopping", flush=True)
    time.sleep(60)
"""
ENDED = """
import time
from falsifier.cli import streams

streams.stop_at_interrupts()
streams.end_at_interrupts(1)
print("ready", flush=True)
time.sleep(60)
"""
CLOSED = """
import os, sys
from falsifier.cli import streams

streams.open_streams()
assert os.open(sys.argv[1], os.O_WRONLY | os.O_CREAT) > 2
print("lost")
print("lost", file=sys.stderr)
streams.settle_streams()
"""


def started(code: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=listen_to_interrupts,
    )


@pytest.mark.parametrize(("code", "interrupts", "ends_with"), [(STUBBORN, 2, 130), (ENDED, 1, 1)])
def test_ctrl_c_ends_without_traceback(code: str, interrupts: int, ends_with: int) -> None:
    process = started(code)
    assert process.stdout is not None
    for _ in range(interrupts):
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=50)
    assert (process.returncode, err) == (ends_with, "")


def test_files_do_not_take_the_place_of_closed_streams(tmp_path: Path) -> None:
    file = tmp_path / "journal"
    command = 'exec "$0" -c "$1" "$2" <&- >&- 2>&-'
    done = subprocess.run(
        ["sh", "-c", command, sys.executable, CLOSED, str(file)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert done.returncode == 0
    assert file.read_text() == ""
