import sys
from pathlib import Path

import pytest

from falsifier.core import linux
from tests.core.children import in_child, is_gone
from tests.patience import wait_until

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="these are services of Linux")

CONFINED = """
linux.confine()
for what in ("environ", "maps"):
    try:
        open(f"/proc/{os.getppid()}/{what}").read()
        print("read")
    except OSError:
        print("refused")
os.rename("a", "b/a")
print(open("b/a").read())
"""


@pytest.mark.skipif(not linux.can_confine(), reason="this kernel cannot confine processes")
def test_a_confined_process_reads_no_other_process_and_uses_files_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").write_text("content")
    (tmp_path / "b").mkdir()
    assert in_child(CONFINED) == "refused\nrefused\ncontent\n"


@LINUX
def test_hidden_memory_is_not_dumped() -> None:
    code = "linux.hide_memory()\nimport ctypes\nprint(ctypes.CDLL(None).prctl(3, 0, 0, 0, 0))"
    assert in_child(code) == "0\n"


@LINUX
def test_descendants_are_ended_also_orphans_and_those_in_sessions_of_their_own() -> None:
    code = """
linux.adopt_orphans()
reading, writing = os.pipe()
for k in range(6):
    if not os.fork():
        if k % 2:
            os.setsid()
        if k % 3 == 0 and os.fork():
            os._exit(0)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.write(writing, f"{os.getpid()} ".encode())
        time.sleep(1000)
os.close(writing)
kept = os.fork()
if not kept:
    os.close(reading)
    time.sleep(1000)
found = b""
while found.count(b" ") < 6:
    found += os.read(reading, 100)
linux.end_descendants(keep=[kept])
print(found.decode(), kept, os.path.exists(f"/proc/{kept}"))
linux.end_descendants()
print(linux.children())
"""
    first, second = in_child(code).splitlines()
    *ended, kept, lived = first.split()
    assert lived == "True"
    assert second == "[]"
    wait_until(lambda: all(is_gone(int(pid)) for pid in (*ended, kept)))


@LINUX
def test_what_descends_from_another_process_is_ended_and_that_is_not() -> None:
    code = """
reading, writing = os.pipe()
other = os.fork()
if not other:
    linux.adopt_orphans()
    for k in range(3):
        if not os.fork():
            os.setsid()
            if os.fork():
                os._exit(0)
            os.write(writing, f"{os.getpid()} ".encode())
            time.sleep(1000)
    time.sleep(1000)
found = b""
while found.count(b" ") < 3:
    found += os.read(reading, 100)
linux.end_descendants_of(other)
print(found.decode(), os.waitpid(other, os.WNOHANG)[0])
os.kill(other, 9)
"""
    *ended, status = in_child(code).split()
    assert (len(ended), status) == (3, "0")
    wait_until(lambda: all(is_gone(int(pid)) for pid in ended))


@LINUX
def test_a_process_ends_with_its_parent() -> None:
    code = """
me = os.getpid()
reading, writing = os.pipe()
pid = os.fork()
if not pid:
    linux.end_with_parent(me)
    os.write(writing, b"x")
    time.sleep(1000)
os.read(reading, 1)
print(pid, flush=True)
os.kill(me, signal.SIGKILL)
"""
    pid = int(in_child(code))
    wait_until(lambda: is_gone(pid))


@LINUX
def test_orphans_are_found_by_a_mark_in_their_environment() -> None:
    code = """
reading, writing = os.pipe()
if not os.fork():
    os.setsid()
    if not os.fork():
        os.close(1)
        os.write(writing, f"{os.getpid()} ".encode())
        time.sleep(1000)
    os._exit(0)
os.wait()
print(os.read(reading, 100).decode(), flush=True)
"""
    pid = int(in_child(code, FALSIFIER_TEST_MARK="this-one"))
    linux.end_marked("FALSIFIER_TEST_MARK", "this")
    assert not is_gone(pid)
    linux.end_marked("FALSIFIER_TEST_MARK", "this-one")
    wait_until(lambda: is_gone(pid))


def test_a_process_ends_as_another_has_ended() -> None:
    code = """
from falsifier.core import linux, posix
for number, signal in ((7, 0), (0, 9), (0, 11)):
    pid = posix.fork()
    if not pid:
        os.kill(os.getpid(), signal) if signal else os._exit(number)
    status = linux.await_end(pid)
    pid = posix.fork()
    if not pid:
        linux.end_like(status)
    print([os.WIFSIGNALED(s) and os.WTERMSIG(s) or os.WEXITSTATUS(s) for s in (status, linux.await_end(pid))])
"""
    assert in_child(code) == "[7, 7]\n[9, 9]\n[11, 11]\n"
