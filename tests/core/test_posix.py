import os
import select
import signal
import socket
import subprocess
import sys

import pytest

from falsifier.core import posix
from tests.core.children import in_child
from tests.patience import HANG

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="these are services of Linux")


@LINUX
@pytest.mark.parametrize("size", [0, 8, 4096, 10_000])
def test_nothing_is_written_past_the_end_of_guarded_memory(size: int) -> None:
    room = f"view = posix.guarded_memory({size}); import ctypes; print(len(view), sum(view), flush=True); "
    within = f"start = ctypes.addressof((ctypes.c_char * {size}).from_buffer(view)); ctypes.memset(start, 1, "
    assert in_child(f"{room}{within}{size}); print(sum(view))") == f"{size} 0\n{size}\n"
    assert in_child(f"{room}{within}{size + 1}); print('damage')") == f"{size} 0\n"


def test_a_group_is_ended() -> None:
    process = subprocess.Popen(["sh", "-c", "sleep 1000 & sleep 1000"], start_new_session=True)
    posix.end_group(process.pid)
    assert process.wait(HANG) == -signal.SIGKILL
    posix.end_group(process.pid)


@LINUX
def test_a_life_becomes_readable_when_the_process_ends() -> None:
    process = subprocess.Popen(["sleep", "1000"])
    life = posix.open_life(process.pid)
    assert life is not None
    assert select.select([life], [], [], 0)[0] == []
    process.kill()
    assert select.select([life], [], [], HANG)[0] == [life]
    process.wait()
    os.close(life)
    assert posix.open_life(process.pid) is None


@LINUX
def test_memory_is_limited_and_cores_are_not_dumped() -> None:
    code = """
import resource
posix.limit_resources(1e-4)
print(resource.getrlimit(resource.RLIMIT_CORE)[0])
try:
    bytearray(1 << 30)
except MemoryError:
    print("refused")
"""
    assert in_child(code) == "0\nrefused\n"


def test_c_output_is_written_line_by_line() -> None:
    code = "posix.flush_lines()\nimport ctypes\nctypes.CDLL(None).puts(b'line')\nos._exit(0)"
    assert in_child(code) == "line\n"


def test_an_exit_code_or_a_signal_is_named() -> None:
    assert posix.exit_text(3) == "it exited with code 3"
    assert posix.exit_text(-11) == "signal SIGSEGV"
    assert posix.exit_text(-250) == "signal 250"


SPEAKS = """
import os
from falsifier.core import posix
sock, line = posix.receive_connection()
sock.sendall(b"here")
os.read(line, 1)
sock.sendall(b" and gone")
os._exit(5)
"""


def test_a_child_has_a_connection_and_a_line_that_tells_of_its_parents_end() -> None:
    ours, theirs = socket.socketpair()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    child = posix.Child([sys.executable, "-c", SPEAKS], environment, theirs)
    assert posix.wait_readable(ours, None, HANG)
    assert posix.receive_now(ours, 100, keep=True) == posix.receive_now(ours, 100) == b"here"
    with pytest.raises(BlockingIOError):
        posix.receive_now(ours, 100)
    assert child.is_alive
    child._line.close()
    assert posix.wait_readable(ours, None, HANG)
    assert ours.recv(100) == b" and gone"
    child.wait(HANG)
    assert child.end() == 5, "its own exit code"
    ours.close()


def test_of_a_life_and_a_connection_the_first_that_says_something_is_told() -> None:
    ours, theirs = socket.socketpair()
    process = subprocess.Popen(["sleep", "1000"])
    life = posix.open_life(process.pid)
    with pytest.raises(TimeoutError):
        posix.wait_readable(ours, life, 0.01)
    process.kill()
    if life is not None:
        assert not posix.wait_readable(ours, life, HANG)
        theirs.sendall(b"x")
        assert posix.wait_readable(ours, life, HANG)
        posix.close_life(life)
    process.wait()
    ours.close()
    theirs.close()
