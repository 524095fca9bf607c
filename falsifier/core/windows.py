"""Processes, connections and memory on Windows; ``posix`` and ``linux`` offer the same elsewhere.

Checked by mypy for Windows, but not run there yet.
"""

import base64
import contextlib
import ctypes
import mmap
import msvcrt
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from ctypes import wintypes
from pathlib import Path

assert sys.platform == "win32"

HAS_FORK = SENDS_FILES = False
FORKS_BY_DEFAULT = False

_SYNCHRONIZE, _WAIT_FINISHED = 0x00100000, 0
_NO_ACCESS = 0x01  # PAGE_NOACCESS
_UNBUFFERED = 4  # _IONBF: Microsoft's C libraries know no line buffering
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
# How often to look whether a process still lives: one cannot wait for that and for a socket together.
_LOOKING_SECONDS = 0.1
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


class _MemoryCounters(ctypes.Structure):
    _fields_ = (
        ("cb", wintypes.DWORD),
        ("PageFaultCount", wintypes.DWORD),
        ("PeakWorkingSetSize", ctypes.c_size_t),
        ("WorkingSetSize", ctypes.c_size_t),
        ("QuotaPeakPagedPoolUsage", ctypes.c_size_t),
        ("QuotaPagedPoolUsage", ctypes.c_size_t),
        ("QuotaPeakNonPagedPoolUsage", ctypes.c_size_t),
        ("QuotaNonPagedPoolUsage", ctypes.c_size_t),
        ("PagefileUsage", ctypes.c_size_t),
        ("PeakPagefileUsage", ctypes.c_size_t),
    )


class Child:
    """A program with one end of a connection, in a job that ends with this process.

    Args:
        command: program and arguments; it calls ``receive_connection`` at its start.
        environment: its environment.
        connection: its end of the connection, which is closed when the program has received it.
        output: descriptor of a file for what it prints; None: its messages go where this process's go.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        connection: socket.socket,
        output: int | None = None,
    ) -> None:
        self._connection = connection
        try:
            self._process = subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL if output is None else output,
                stderr=output,
                creationflags=subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW,
                bufsize=0,
            )
            self.pid = self._process.pid
            self._job = _job(_KILL_WITH_JOB)
            _kernel.AssignProcessToJobObject(
                wintypes.HANDLE(self._job), wintypes.HANDLE(_handle(self._process))
            )
            assert self._process.stdin is not None, "it is a pipe"
            self._line = self._process.stdin
            with contextlib.suppress(OSError):  # it has ended already
                self._line.write(base64.b64encode(connection.share(self.pid)) + b"\n")
        except BaseException:
            connection.close()
            raise

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def settle(self) -> None:
        """Close the program's end of the connection: it has received it."""
        self._connection.close()

    def wait(self, limit: float) -> None:
        """Wait for the end of the process, at most this many seconds."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(limit)

    def end(self) -> int:
        """End the process and what it has started; return its exit code.

        A process that has already ended keeps its own exit code.
        """
        self._connection.close()
        _kernel.TerminateJobObject(wintypes.HANDLE(self._job), _KILLED)
        with contextlib.suppress(OSError):
            self._process.kill()
        _kernel.CloseHandle(wintypes.HANDLE(self._job))
        self._line.close()
        return self._process.wait()

    def forget(self) -> None:
        """Leave the process to another one, of which this is a copy; there are none here."""


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


def interpreter() -> str:
    """Return the path of this Python, to start another one with.

    That of a virtual environment would only start that of the installation, as another process.
    """
    return str(getattr(sys, "_base_executable", None) or sys.executable)


def receive_connection() -> tuple[socket.socket, int]:
    """Return the connection of a program that was started as a ``Child``, and a line to its parent.

    The line is a descriptor; reading from it ends when the parent has ended.
    """
    said = b""
    while not said.endswith(b"\n"):
        part = os.read(0, 1)
        if not part:
            os._exit(1)  # the parent has ended
        said += part
    line = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    return socket.fromshare(base64.b64decode(said)), line


def on_fork(callback: Callable[[], None]) -> None:
    """Do nothing: processes are never forked here."""


def open_life(pid: int) -> int | None:
    """Open a handle that tells whether a process has ended; None if it has."""
    return _kernel.OpenProcess(_SYNCHRONIZE, False, pid) or None  # noqa: FBT003


def close_life(life: int) -> None:
    """Close what ``open_life`` has opened."""
    _kernel.CloseHandle(wintypes.HANDLE(life))


def is_running(pid: int) -> bool:
    """Whether there is a process with this number; also if it is another user's, or cannot be asked."""
    life = open_life(pid)
    if life is not None:
        close_life(life)
    return life is not None or ctypes.get_last_error() != _NO_SUCH_PROCESS


def exit_text(code: int) -> str:
    """Describe the end of a process by its exit code."""
    code &= 0xFFFFFFFF
    if code in _CRASHES:
        return f"{_CRASHES[code]}, exit code 0x{code:X}"
    return f"it exited with code {code if code < 1 << 30 else hex(code)}"


def limit_sending(sock: socket.socket, seconds: float) -> None:
    """Let sending fail that takes longer than this; send small messages at once."""
    sock.setsockopt(socket.SOL_SOCKET, 0x1005, max(1, int(seconds * 1e3)))  # SO_SNDTIMEO, in ms
    # Pairs of sockets are TCP connections here.
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def receive_now(sock: socket.socket, most: int, *, keep: bool = False) -> bytes:
    """Receive what is there.

    Args:
        sock: where from.
        most: maximum number of bytes.
        keep: whether the next call receives it again.

    Raises:
        BlockingIOError: if nothing is there.
    """
    if not select.select([sock], [], [], 0)[0]:
        raise BlockingIOError
    return sock.recv(most, socket.MSG_PEEK if keep else 0)


def wait_readable(sock: socket.socket, life: int | None, seconds: float) -> bool:
    """Wait until there is something to receive.

    Args:
        sock: where from.
        life: see ``open_life``; its end ends the wait, too.
        seconds: longest time to wait.

    Returns:
        Whether there is something; False if the life has ended instead.

    Raises:
        TimeoutError: if neither happens in time.
    """
    until = time.monotonic() + seconds
    while True:
        left = max(0.0, until - time.monotonic())
        ended = life is not None and _kernel.WaitForSingleObject(wintypes.HANDLE(life), 0) == _WAIT_FINISHED
        # What the process sent before its end is still received.
        if select.select([sock], [], [], 0.0 if ended else min(left, _LOOKING_SECONDS))[0]:
            return True
        if ended:
            return False
        if not left:
            raise TimeoutError


def send_descriptors(sock: socket.socket, descriptors: Sequence[int]) -> None:
    """Raise an error: open files cannot be sent here, and only forked workers need that."""
    raise OSError("open files cannot be sent to other processes on Windows")


def receive_descriptors(sock: socket.socket, count: int) -> list[int]:
    """Raise an error: see ``send_descriptors``."""
    raise OSError("open files cannot be received from other processes on Windows")


def yield_processor() -> None:
    """Let other processes run."""
    time.sleep(0)


def start_silent_tracker() -> None:
    """Do nothing: the system frees the semaphores of processes that have ended."""


def confine() -> bool:
    """Return False: processes of one user are not kept apart here."""
    return False


def can_confine() -> bool:
    """Return False: see ``confine``."""
    return False


def hide_memory() -> None:
    """Do nothing: a process cannot hide its memory from others of the same user here."""


def adopt_orphans() -> None:
    """Do nothing: what a worker starts belongs to its job."""


def end_descendants(keep: Collection[int] = ()) -> None:
    """Do nothing: what a worker starts ends with its job."""


def guarded_memory(size: int) -> memoryview:
    """Allocate zeroed bytes that end where accessible memory ends.

    Native code that writes past their end stops with an access violation there.
    """
    page = mmap.PAGESIZE
    usable = -(-size // page) * page
    memory = mmap.mmap(-1, usable + page)
    guard = ctypes.addressof(ctypes.c_char.from_buffer(memory)) + usable
    before = wintypes.DWORD()
    _kernel.VirtualProtect(ctypes.c_void_p(guard), ctypes.c_size_t(page), _NO_ACCESS, ctypes.byref(before))
    return memoryview(memory)[usable - size : usable]


def limit_resources(memory_share: float) -> None:
    """Allow this process only this share of the machine's memory."""
    job = _job(_LIMIT_PROCESS_MEMORY, int(machine_memory() * memory_share))
    _kernel.AssignProcessToJobObject(wintypes.HANDLE(job), wintypes.HANDLE(_kernel.GetCurrentProcess()))


def memory_limits() -> dict[str, int]:
    """Return nothing: processes have no such limits here."""
    return {}


def most_memory_used() -> int:
    """Return how much memory this process has used at most, in KiB."""
    counters = _MemoryCounters()
    counters.cb = ctypes.sizeof(counters)
    _kernel.K32GetProcessMemoryInfo(
        wintypes.HANDLE(_kernel.GetCurrentProcess()), ctypes.byref(counters), counters.cb
    )
    return int(counters.PeakWorkingSetSize) >> 10


def flush_lines() -> None:
    """Let C's stdout write at once, so that what the FMU printed before a crash is not lost.

    An FMU that contains a C library of its own has another stdout, which this does not reach.
    """
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL("ucrtbase")
        library.__acrt_iob_func.restype = ctypes.c_void_p
        library.setvbuf(ctypes.c_void_p(library.__acrt_iob_func(1)), None, _UNBUFFERED, ctypes.c_size_t(0))


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
