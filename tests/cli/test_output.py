import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from falsifier.cli.files import checked_picture
from falsifier.cli.output import say
from falsifier.errors import SpecError
from falsifier.views.plotting.axes import save_figure
from tests.command import ROOT, listen_to_interrupts


def test_results_have_no_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    say("a\x1b[2Jb\n", nl=False)
    assert capsys.readouterr().out == "a\N{REPLACEMENT CHARACTER}[2Jb\n"


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_only_pictures_that_commands_have_written_are_replaced(ending: str, tmp_path: Path) -> None:
    picture = tmp_path / f"picture.{ending}"
    save_figure(Figure(), picture)
    assert checked_picture(picture) == picture
    Figure().savefig(picture)
    with pytest.raises(SpecError, match="exists and is kept"):
        checked_picture(picture)


# A minute; a signal that arrives just before a sleep is handled after it, so that each is short.
REST = "for _ in range(600): time.sleep(0.1)"
# A command that takes the first Ctrl-C badly: it goes on for a minute.
STUBBORN = f"""
import sys, time
from falsifier.cli import output

output.stop_at_interrupts()
try:
    print("ready", flush=True)
    {REST}
except KeyboardInterrupt:
    print("stopping", flush=True)
    {REST}
"""
ENDED = f"""
import time
from falsifier.cli import output

output.stop_at_interrupts()
output.end_at_interrupts(1)
print("ready", flush=True)
{REST}
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


# As pydantic does while it makes a class: Ctrl-C often comes while a command is still being imported.
REPLACED = """
from unittest.mock import patch
from falsifier import cli

def replace(*_):
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise TypeError(f"{type(error).__name__}: ") from None

with patch("falsifier.cli.check_memory_limits", replace):
    cli.main()
"""


def test_ctrl_c_that_a_library_replaced_by_an_error_of_its_own_is_no_defect() -> None:
    process = started(REPLACED)
    _, err = process.communicate(timeout=50)
    assert (process.returncode, err) == (130, "interrupted\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(("code", "interrupts", "ends_with"), [(STUBBORN, 2, 130), (ENDED, 1, 1)])
def test_ctrl_c_ends_without_traceback(code: str, interrupts: int, ends_with: int, number: int) -> None:
    process = started(code)
    assert process.stdout is not None
    for place in range(interrupts):
        process.stdout.readline()
        if place and number != signal.SIGINT:
            time.sleep(1.1)
        process.send_signal(number)
    _, err = process.communicate(timeout=50)
    assert (process.returncode, err) == (ends_with, "")


def test_a_signal_that_comes_twice_at_once_counts_once() -> None:
    process = started(STUBBORN.replace(f"    {REST}\n", "    time.sleep(2)\n    print('summary')\n"))
    assert process.stdout is not None
    for _ in range(2):
        process.stdout.readline()
        process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=50)
    assert (process.returncode, out, err) == (0, "summary\n", "")
