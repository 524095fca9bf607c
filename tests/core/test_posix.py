import fcntl
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from falsifier.core import posix, posix_files
from falsifier.fmu.process.rights import Rights, encoded
from falsifier.fmu.process.workplace import worker_program
from tests.patience import HANG


def test_an_exit_code_or_a_signal_is_named() -> None:
    assert posix.exit_text(3) == "it exited with code 3"
    assert posix.exit_text(-11) == "signal SIGSEGV"
    assert posix.exit_text(-250) == "signal 250"


def test_on_windows_the_import_says_where_to_install_it() -> None:
    code = "import sys; sys.platform = 'win32'; import falsifier"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 1 and "ImportError: " in done.stderr and "WSL2" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="files have seals on Linux only")
def test_nobody_can_keep_others_from_writing_a_file_without_a_name() -> None:
    with posix_files.unnamed_file() as file, pytest.raises(PermissionError):
        fcntl.fcntl(file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_GROW)


def test_a_program_ends_as_the_one_that_it_watches(tmp_path: Path) -> None:
    """The shell takes the place of the worker; descriptors 0 and 3 are the connection."""
    script = "read line; echo here >&3; read line; exit 5"
    rights = encoded(Rights(), (tmp_path,), (), memory=0, command=("/bin/sh", "-c", script))
    with posix_files.sealed_file(8) as output, posix_files.sealed_file(8) as shared:
        path = [str(worker_program(tmp_path))]
        program = posix.WatchedProgram(path, {}, output.fileno(), rights, shared.fileno())
        with pytest.raises(TimeoutError):
            program.read(100, 0.0)
        program.send(b"hello\n", HANG)
        assert program.read(100, HANG) == b"here\n"
        with pytest.raises(TimeoutError):
            program.read(100, 0.01)
        assert program.is_alive
        program.send(b"end\n", HANG)
        assert program.ends_within(HANG)
        assert program.end() == 5


@pytest.mark.usefixtures("stoppable")
@pytest.mark.parametrize(("interrupts", "done"), [(1, ["one", "two"]), (2, ["one"])])
def test_a_step_is_completed_before_the_first_interrupt(interrupts: int, done: list[str]) -> None:
    steps = []
    with pytest.raises(KeyboardInterrupt), posix.undisturbed():
        steps.append("one")
        for _ in range(interrupts):
            signal.raise_signal(signal.SIGINT)
        steps.append("two")
    assert steps == done
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize(
    "sent",
    [
        [signal.SIGTERM, signal.SIGTERM],  # as timeout sends it, to the command and to its group
        [signal.SIGINT, signal.SIGTERM],  # a handler of the user's may go on
    ],
)
def test_what_comes_during_a_step_is_told_after_it(sent: list[signal.Signals]) -> None:
    told: list[object] = []
    before = {number: signal.signal(number, lambda number, _: told.append(number)) for number in set(sent)}
    try:
        with posix.undisturbed(), posix.undisturbed():
            for number in sent:
                signal.raise_signal(number)
            told.append("step")
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert told == ["step", *sent]
