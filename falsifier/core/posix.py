"""Processes, connections and memory on Linux and macOS; ``windows`` offers the same.

Each function does as much as the system offers; what only Linux has is in ``linux``.
"""

import contextlib
import ctypes
import mmap
import os
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from uuid import uuid4

from falsifier.core import linux

assert sys.platform != "win32"

HAS_FORK = SENDS_FILES = True
FORKS_BY_DEFAULT = sys.platform == "linux"

# What a child and its descendants have in their environment.
_MARK = "FALSIFIER_PROCESS"
_LINE_BUFFERED = 1  # _IOLBF of glibc, musl and Darwin
_TIMEVAL = struct.Struct("@ll")
# Filter in the format of python -W: warnings whose message starts with this word.
_TRACKER_FILTER = "ignore:resource_tracker"


class Child:
    """A program with one end of a connection, in a process group of its own.

    Args:
        command: program and arguments; it calls ``receive_connection`` at its start.
        environment: its environment.
        connection: its end of the connection, which is closed here.
        output: descriptor of a file for what it prints; None: its messages go where this process's go.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        connection: socket.socket,
        output: int | None = None,
    ) -> None:
        self._mark = uuid4().hex
        with connection:
            self._process = subprocess.Popen(
                command,
                env={**environment, _MARK: self._mark},
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL if output is None else output,
                stderr=output,
                pass_fds=[connection.fileno()],
                start_new_session=True,
                bufsize=0,
            )
            self.pid = self._process.pid
            assert self._process.stdin is not None, "it is a pipe"
            self._line = self._process.stdin
            with contextlib.suppress(OSError):  # it has ended already
                self._line.write(b"%d\n" % connection.fileno())

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def settle(self) -> None:
        """Take note that the program has received its connection."""

    def wait(self, limit: float) -> None:
        """Wait for the end of the process, at most this many seconds."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(limit)

    def end(self) -> int:
        """Kill the process and what it has started; return its exit code, negative for a signal.

        A process that has already ended keeps its own exit code.
        """
        if self._process.returncode is None:
            linux.end_descendants_of(self.pid)
            end_group(self.pid)
            self._process.kill()
        self._line.close()
        code = self._process.wait()
        linux.end_marked(_MARK, self._mark)
        return code

    def forget(self) -> None:
        """Leave the process to another one, of which this is a copy."""
        self._line.close()
        self._process.returncode = 0  # not this process's child, so it cannot be waited for


def interpreter() -> str:
    """Return the path of this Python, to start another one with."""
    return sys.executable


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
    return socket.socket(fileno=int(said)), line


def on_fork(callback: Callable[[], None]) -> None:
    """Call a function in each forked copy of this process."""
    os.register_at_fork(after_in_child=callback)


def fork() -> int:
    """Fork; return 0 in the copy, and its process id in this process."""
    return os.fork()


def lead_group() -> None:
    """Make this process the first of a new process group."""
    os.setpgid(0, 0)


def reap(pid: int) -> int:
    """Kill a child, and what is in its process group; return its exit code, negative for a signal."""
    end_group(pid)
    kill(pid)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def kill(pid: int) -> None:
    """Kill a process, if it is still there."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def is_running(pid: int) -> bool:
    """Whether there is a process with this number, of whichever user."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def end_group(group: int) -> None:
    """Kill a process group: what a process has started, where its descendants cannot be found otherwise."""
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)


def open_life(pid: int) -> int | None:
    """Open a descriptor that becomes readable when a process ends; None where there is none (not Linux)."""
    if sys.platform == "linux" and hasattr(os, "pidfd_open"):
        with contextlib.suppress(OSError):
            return os.pidfd_open(pid)
    return None


def close_life(life: int) -> None:
    """Close what ``open_life`` has opened."""
    os.close(life)


def exit_text(code: int) -> str:
    """Describe the end of a process by its exit code, which is negative for a signal."""
    if code >= 0:
        return f"it exited with code {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"


def limit_sending(sock: socket.socket, seconds: float) -> None:
    """Let sending fail that takes longer than this."""
    # Zero would mean that there is no limit.
    whole, rest = divmod(max(seconds, 1e-6), 1.0)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIMEVAL.pack(int(whole), int(rest * 1e6)))


def receive_now(sock: socket.socket, most: int, *, keep: bool = False) -> bytes:
    """Receive what is there.

    Args:
        sock: where from.
        most: maximum number of bytes.
        keep: whether the next call receives it again.

    Raises:
        BlockingIOError: if nothing is there.
    """
    return sock.recv(most, socket.MSG_DONTWAIT | (socket.MSG_PEEK if keep else 0))


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
    waiting = select.poll()
    waiting.register(sock, select.POLLIN)
    if life is not None:
        waiting.register(life, select.POLLIN)
    ready = [descriptor for descriptor, _ in waiting.poll(seconds * 1e3)]
    if not ready:
        raise TimeoutError
    return sock.fileno() in ready


def send_descriptors(sock: socket.socket, descriptors: Sequence[int]) -> None:
    """Send open files to another process on this machine."""
    socket.send_fds(sock, [b"\0"], list(descriptors))


def receive_descriptors(sock: socket.socket, count: int) -> list[int]:
    """Receive the open files that ``send_descriptors`` sends."""
    return socket.recv_fds(sock, 1, count)[1]


def yield_processor() -> None:
    """Let other processes run."""
    os.sched_yield()


def start_silent_tracker() -> None:
    """Start multiprocessing's resource tracker, which frees a pool's semaphores, without its warnings.

    It still frees semaphores left behind by a killed process. Its warning would reach the terminal after the
    command has ended, and the user could do nothing about it.
    """
    from multiprocessing.resource_tracker import ensure_running

    sys.warnoptions.append(_TRACKER_FILTER)  # the tracker is started with the options of this interpreter
    try:
        ensure_running()
    finally:
        sys.warnoptions.remove(_TRACKER_FILTER)


def guarded_memory(size: int) -> memoryview:
    """Allocate zeroed bytes that end where accessible memory ends.

    Native code that writes past their end stops with a signal there, before it damages anything else.
    """
    page = mmap.PAGESIZE
    usable = -(-size // page) * page
    memory = mmap.mmap(-1, usable + page)
    guard = ctypes.addressof(ctypes.c_char.from_buffer(memory)) + usable
    ctypes.CDLL(None).mprotect(ctypes.c_void_p(guard), ctypes.c_size_t(page), 0)
    return memoryview(memory)[usable - size : usable]


def limit_resources(memory_share: float) -> None:
    """Allow this process no core dumps, and only this share of the machine's memory (Linux)."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        # RLIMIT_DATA counts what a model allocates, not the address space that runtimes merely reserve.
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        _, allowed = resource.getrlimit(resource.RLIMIT_DATA)
        limit = int(memory * memory_share)
        limit = limit if allowed == resource.RLIM_INFINITY else min(limit, allowed)
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def flush_lines() -> None:
    """Make C's stdout line-buffered, so that what the FMU printed before a crash is not lost."""
    libc = ctypes.CDLL(None)
    with contextlib.suppress(AttributeError, ValueError):
        stdout = ctypes.c_void_p.in_dll(libc, "stdout")
        libc.setvbuf(stdout, None, _LINE_BUFFERED, 0)


def memory_limits() -> dict[str, int]:
    """Return the limits of this process's memory in bytes, by the option of ``ulimit`` that sets them."""
    limits = {"d": resource.RLIMIT_DATA, "v": resource.RLIMIT_AS}
    allowed = {option: resource.getrlimit(limit)[0] for option, limit in limits.items()}
    return {option: most for option, most in allowed.items() if most != resource.RLIM_INFINITY}


def most_memory_used() -> int:
    """Return how much memory this process has used at most, in KiB."""
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used if sys.platform == "linux" else used >> 10
