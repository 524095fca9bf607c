"""Processes, memory and files on Windows; ``posix`` and ``posix_files`` offer the same elsewhere.

Checked by mypy for Windows, but not run there yet.
"""

import contextlib
import ctypes
import msvcrt
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from ctypes import wintypes
from pathlib import Path
from typing import IO, Any

assert sys.platform == "win32"


_SYNCHRONIZE, _WAIT_FINISHED = 0x00100000, 0
_EXTENDED_LIMITS = 9  # JobObjectExtendedLimitInformation
_LIMIT_PROCESS_MEMORY, _KILL_WITH_JOB = 0x00000100, 0x00002000
_KILLED = 1  # exit code of what is ended here
# Exit codes of processes that crashed (ntstatus.h).
_CRASHES = {
    0xC0000005: "access violation",
    0xC000001D: "illegal instruction",
    0xC0000094: "integer division by zero",
    0xC00000FD: "stack overflow",
    0xC0000135: "a library was not found",
    0xC0000374: "heap corruption",
    0xC0000409: "abort",
}
# A file that another program, such as a virus scanner, has open cannot be replaced until that closes it.
_REPLACING_SECONDS = 2.0
_PEEKING_SECONDS = 0.0005
# Share of the machine's memory that a program may allocate.
_MEMORY_SHARE = 0.8

# ERROR_INVALID_PARAMETER, which OpenProcess reports for a number without a process.
_NO_SUCH_PROCESS = 87
_kernel = ctypes.WinDLL("kernel32", use_last_error=True)
_kernel.CreateJobObjectW.restype = wintypes.HANDLE
_kernel.OpenProcess.restype = wintypes.HANDLE
_kernel.GetCurrentProcess.restype = wintypes.HANDLE


class _BasicLimits(ctypes.Structure):
    _fields_ = (
        ("PerProcessUserTimeLimit", ctypes.c_int64),
        ("PerJobUserTimeLimit", ctypes.c_int64),
        ("LimitFlags", wintypes.DWORD),
        ("MinimumWorkingSetSize", ctypes.c_size_t),
        ("MaximumWorkingSetSize", ctypes.c_size_t),
        ("ActiveProcessLimit", wintypes.DWORD),
        ("Affinity", ctypes.c_size_t),
        ("PriorityClass", wintypes.DWORD),
        ("SchedulingClass", wintypes.DWORD),
    )


class _Limits(ctypes.Structure):
    _fields_ = (
        ("BasicLimitInformation", _BasicLimits),
        ("IoInfo", ctypes.c_uint64 * 6),
        ("ProcessMemoryLimit", ctypes.c_size_t),
        ("JobMemoryLimit", ctypes.c_size_t),
        ("PeakProcessMemoryUsed", ctypes.c_size_t),
        ("PeakJobMemoryUsed", ctypes.c_size_t),
    )


class _MemoryStatus(ctypes.Structure):
    _fields_ = (
        ("dwLength", wintypes.DWORD),
        ("dwMemoryLoad", wintypes.DWORD),
        ("ullTotalPhys", ctypes.c_uint64),
        ("ullAvailPhys", ctypes.c_uint64),
        ("ullTotalPageFile", ctypes.c_uint64),
        ("ullAvailPageFile", ctypes.c_uint64),
        ("ullTotalVirtual", ctypes.c_uint64),
        ("ullAvailVirtual", ctypes.c_uint64),
        ("ullAvailExtendedVirtual", ctypes.c_uint64),
    )


class Program:
    """A program that answers requests, in a job that ends with this process.

    It has the requests on its standard input, prints to the file of its output, and is told which handle its
    replies go to.

    Args:
        command: program and arguments.
        environment: its environment.
        output: descriptor of a file for what it prints.
        policy: not used here: nothing is enforced.
        shared: not used here: memory is shared by its path.
        replies: not used here.

    Attributes:
        pid: its process id.
        replies_place: what the program must be told of where its replies go.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        output: int,
        policy: bytes,
        shared: int,
        replies: Path | None = None,
    ) -> None:
        del policy, shared, replies
        self._replies, theirs = os.pipe()
        handle = msvcrt.get_osfhandle(theirs)
        os.set_handle_inheritable(handle, True)  # noqa: FBT003
        try:
            self._process = subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                startupinfo=subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]}),
                creationflags=subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW,
                bufsize=0,
            )
        finally:
            os.close(theirs)
        self._job = _job(_KILL_WITH_JOB | _LIMIT_PROCESS_MEMORY, int(machine_memory() * _MEMORY_SHARE))
        _kernel.AssignProcessToJobObject(wintypes.HANDLE(self._job), wintypes.HANDLE(_handle(self._process)))
        assert self._process.stdin is not None, "it is a pipe"
        self._requests = self._process.stdin
        self.pid = self._process.pid
        self.replies_place = str(handle)

    def send(self, data: bytes, seconds: float) -> None:
        """Send a request; see ``posix``. There is no limit in time here."""
        del seconds
        try:
            self._requests.write(data)
        except OSError as error:
            raise ConnectionError from error

    def receive_now(self, most: int) -> bytes:
        """Return at most this many bytes of replies that are there; see ``posix``."""
        count = wintypes.DWORD()
        pipe = wintypes.HANDLE(msvcrt.get_osfhandle(self._replies))
        if not _kernel.PeekNamedPipe(pipe, None, 0, None, ctypes.byref(count), None):
            return b""
        if not count.value:
            raise BlockingIOError
        return os.read(self._replies, min(most, count.value))

    def wait(self, seconds: float) -> bool:
        """Wait until there is something to receive; see ``posix``."""
        until = time.monotonic() + seconds
        count = wintypes.DWORD()
        pipe = wintypes.HANDLE(msvcrt.get_osfhandle(self._replies))
        while True:
            ended = not self.is_alive
            # What the process sent before its end is still received.
            is_open = _kernel.PeekNamedPipe(pipe, None, 0, None, ctypes.byref(count), None)
            if count.value or not is_open:
                return bool(count.value) or not ended
            if ended:
                return False
            if time.monotonic() > until:
                raise TimeoutError
            time.sleep(_PEEKING_SECONDS)

    @property
    def is_alive(self) -> bool:
        """Whether the program is running."""
        return self._process.poll() is None

    def ends_within(self, seconds: float) -> bool:
        """Whether the program ends by itself within this time."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)
        return not self.is_alive

    def stop(self) -> None:
        """Kill the program while another thread waits for it."""
        _kernel.TerminateJobObject(wintypes.HANDLE(self._job), _KILLED)

    def told(self) -> bytes:
        """Return nothing: no process watches the program."""
        return b""

    def end(self) -> int:
        """Kill the program and what it has started; return its exit code; see ``posix``."""
        self.stop()
        with contextlib.suppress(OSError):
            self._process.kill()
        code = self._process.wait()
        _kernel.CloseHandle(wintypes.HANDLE(self._job))
        self._requests.close()
        os.close(self._replies)
        return code

    def forget(self) -> None:
        """Leave the program to another process, of which this is a copy; there are none here."""


def machine_memory() -> int:
    """Return the memory of this machine in bytes; 0 if it is unknown."""
    status = _MemoryStatus()
    status.dwLength = ctypes.sizeof(status)
    return int(status.ullTotalPhys) if _kernel.GlobalMemoryStatusEx(ctypes.byref(status)) else 0


def on_fork(callback: Callable[[], None]) -> None:
    """Do nothing: processes are never forked here."""


def is_running(pid: int) -> bool:
    """Whether there is a process with this number; also if it is another user's, or cannot be asked."""
    process = _kernel.OpenProcess(_SYNCHRONIZE, False, pid)  # noqa: FBT003
    if process:
        _kernel.CloseHandle(wintypes.HANDLE(process))
    return bool(process) or ctypes.get_last_error() != _NO_SUCH_PROCESS


def exit_text(code: int) -> str:
    """Describe the end of a process by its exit code."""
    code &= 0xFFFFFFFF
    if code in _CRASHES:
        return f"{_CRASHES[code]}, exit code 0x{code:X}"
    return f"it exited with code {code if code < 1 << 30 else hex(code)}"


def yield_processor() -> None:
    """Let other processes run."""
    time.sleep(0)


def start_silent_tracker() -> None:
    """Do nothing: the system frees the semaphores of processes that have ended."""


def can_confine() -> bool:
    """Return False: see ``confine``."""
    return False


def hide_memory() -> None:
    """Do nothing: a process cannot hide its memory from others of the same user here."""


def memory_limits() -> dict[str, int]:
    """Return nothing: processes have no such limits here."""
    return {}


def sealed_file(size: int, *, may_grow: bool = False) -> IO[bytes]:
    """Open a temporary file of this size that is removed when it is closed; the size is not sealed here."""
    del may_grow
    file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
    file.truncate(size)
    return file


def lock_file(path: Path) -> int | None:
    """Create and lock a file; the lock ends with the process, or when the returned descriptor is closed.

    Returns:
        The descriptor; None if another process has locked the file.
    """
    if path.is_symlink():
        raise OSError(f"{path} is a link")
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOINHERIT, 0o600)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def can_seal() -> bool:
    """Return False: see ``sealed_file``."""
    return False


def write_at(descriptor: int, data: bytes, position: int) -> None:
    """Write bytes to a position of a file; the file's own is the same afterwards."""
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        os.lseek(descriptor, position, os.SEEK_SET)
        os.write(descriptor, data)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)


def read_at(descriptor: int, most: int, position: int) -> bytes:
    """Read at most this many bytes of a file from a position; the file's own is the same afterwards."""
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        os.lseek(descriptor, position, os.SEEK_SET)
        return os.read(descriptor, most)
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)


def replace(source: Path, target: Path) -> None:
    """Put a file in the place of another one, atomically; wait a moment for programs that have it open."""
    until = time.monotonic() + _REPLACING_SECONDS
    while True:
        try:
            source.replace(target)
        except PermissionError:
            if time.monotonic() > until or target.is_dir():
                raise
            time.sleep(0.02)
        else:
            return


def user() -> str:
    """Return what tells this user's temporary folders from those of others: nothing, they are apart."""
    return "user"


def homes() -> tuple[Path, ...]:
    """Return the user's home folder."""
    return (Path.home(),)


def is_root() -> bool:
    """Return False: no user reads all files here."""
    return False


def is_own(path: Path) -> bool:
    """Whether a file or folder belongs to this user: each user has a temporary folder of their own."""
    return path.exists()


def is_private(folder: Path) -> bool:
    """Whether no other user can write to a folder: so for temporary ones."""
    return folder.is_dir()


def forbids_programs(folder: Path) -> bool:
    """Return False: no folder does."""
    return False


def remove_tree(path: Path) -> None:
    """Remove a folder with all its contents, files that are write-protected included; ignore errors."""

    def unprotect(remove: Callable[[str], Any], name: str, _error: object) -> None:
        with contextlib.suppress(OSError):
            Path(name).chmod(stat.S_IWRITE)
            remove(name)

    whole = f"\\\\?\\{path.absolute()}"  # long paths need this prefix
    if sys.version_info >= (3, 12):
        shutil.rmtree(whole, onexc=unprotect)
    else:
        shutil.rmtree(whole, onerror=unprotect)


def _job(flags: int, process_memory: int = 0) -> int:
    """Return a handle of a new job with these limits."""
    job = int(_kernel.CreateJobObjectW(None, None) or 0)
    limits = _Limits()
    limits.BasicLimitInformation.LimitFlags = flags
    limits.ProcessMemoryLimit = process_memory
    _kernel.SetInformationJobObject(
        wintypes.HANDLE(job), _EXTENDED_LIMITS, ctypes.byref(limits), ctypes.sizeof(limits)
    )
    return job


def _handle(process: "subprocess.Popen[bytes]") -> int:
    return int(process._handle)  # type: ignore[attr-defined]
