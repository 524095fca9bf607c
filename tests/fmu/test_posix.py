import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from falsifier.fmu import posix
from tests.patience import HANG, wait_until

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="these are services of Linux")


def in_child(code: str, **environment: str) -> str:
    """What a process prints that runs this code."""
    done = subprocess.run(
        [sys.executable, "-c", "import os, signal, time\nfrom falsifier.fmu import posix\n" + code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
        timeout=HANG,
    )
    return done.stdout


def is_gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


@LINUX
@pytest.mark.parametrize("size", [0, 8, 4096, 10_000])
def test_nothing_is_written_past_the_end_of_guarded_memory(size: int) -> None:
    room = f"view = posix.guarded_memory({size}); import ctypes; print(len(view), sum(view), flush=True); "
    within = f"start = ctypes.addressof((ctypes.c_char * {size}).from_buffer(view)); ctypes.memset(start, 1, "
    assert in_child(f"{room}{within}{size}); print(sum(view))") == f"{size} 0\n{size}\n"
    assert in_child(f"{room}{within}{size + 1}); print('damage')") == f"{size} 0\n"


@LINUX
def test_a_sealed_file_keeps_its_size() -> None:
    with posix.sealed_file(4096) as file:
        assert os.fstat(file.fileno()).st_size == 4096
        for size in (0, 8192):
            with pytest.raises(PermissionError):
                os.ftruncate(file.fileno(), size)


def test_a_file_is_locked_once(tmp_path: Path) -> None:
    first = posix.lock_file(tmp_path / "lock")
    assert first is not None
    assert posix.lock_file(tmp_path / "lock") is None
    os.close(first)
    second = posix.lock_file(tmp_path / "lock")
    assert second is not None
    os.close(second)


def test_a_lock_is_not_taken_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "lock").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="lock"):
        posix.lock_file(tmp_path / "lock")
    assert not (tmp_path / "elsewhere").exists()


CONFINED = """
posix.confine()
for what in ("environ", "maps"):
    try:
        open(f"/proc/{os.getppid()}/{what}").read()
        print("read")
    except OSError:
        print("refused")
os.rename("a", "b/a")
print(open("b/a").read())
"""


@pytest.mark.skipif(not posix.can_confine(), reason="this kernel cannot confine processes")
def test_a_confined_process_reads_no_other_process_and_uses_files_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").write_text("content")
    (tmp_path / "b").mkdir()
    assert in_child(CONFINED) == "refused\nrefused\ncontent\n"


@LINUX
def test_hidden_memory_is_not_dumped() -> None:
    code = "posix.hide_memory()\nimport ctypes\nprint(ctypes.CDLL(None).prctl(3, 0, 0, 0, 0))"
    assert in_child(code) == "0\n"


@LINUX
def test_descendants_are_ended_also_orphans_and_those_in_sessions_of_their_own() -> None:
    code = """
posix.adopt_orphans()
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
posix.end_descendants(keep=[kept])
print(found.decode(), kept, os.path.exists(f"/proc/{kept}"))
posix.end_descendants()
print(posix.children())
"""
    first, second = in_child(code).splitlines()
    *ended, kept, lived = first.split()
    assert lived == "True"
    assert second == "[]"
    wait_until(lambda: all(is_gone(int(pid)) for pid in (*ended, kept)))


def test_a_group_is_ended() -> None:
    process = subprocess.Popen(["sh", "-c", "sleep 1000 & sleep 1000"], start_new_session=True)
    posix.end_group(process.pid)
    assert process.wait(HANG) == -signal.SIGKILL
    posix.end_group(process.pid)


@LINUX
def test_a_process_ends_with_its_parent() -> None:
    code = """
me = os.getpid()
reading, writing = os.pipe()
pid = os.fork()
if not pid:
    posix.end_with_parent(me)
    os.write(writing, b"x")
    time.sleep(1000)
os.read(reading, 1)
print(pid, flush=True)
os.kill(me, signal.SIGKILL)
"""
    pid = int(in_child(code))
    wait_until(lambda: is_gone(pid))


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
