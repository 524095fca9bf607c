"""Processes, connections and memory on Linux and macOS; ``windows`` offers the same.

Each function does as much as the system offers; what only Linux has is in ``linux``.
"""

import contextlib
import ctypes
import fcntl
import mmap
import os
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from uuid import uuid4

from falsifier.core import linux

assert sys.platform != "win32"

HAS_FORK = SENDS_FILES = True
FORKS_BY_DEFAULT = sys.platform == "linux"

# What a child and its descendants have in their environment.
_MARK = "FALSIFIER_PROCESS"
_LINE_BUFFERED = 1  # _IOLBF of glibc, musl and Darwin
# A program's end is waited for at most this long; then the process that watches it is killed.
_ENDING_SECONDS = 5.0
_MOST_TOLD = 1 << 16
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


class Program:
    """A program that answers requests, and the process that watches it, which is the one that is started.

    It has the requests on descriptor 0, prints to 1 and 2, and sends its replies to 3; 4 is shared memory. It
    ends with all that it has started, and the process that watches it ends in the same way; 5 is the line to
    that one.

    Args:
        command: program and arguments; the path of the program is absolute.
        environment: its environment.
        output: descriptor of a file for what it prints.
        policy: what the process that watches it is told.
        shared: descriptor of memory that it shares.
        replies: path of a named pipe for its replies, which is made here; None: they come from descriptor 3.

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
        theirs, self._requests = os.pipe()
        self._line, end_of_line = socket.socketpair()
        if replies is None:
            self._replies, answers = os.pipe()
        else:
            os.mkfifo(replies, 0o600)
            # Open for writing too, so that it has no end before the program opens it.
            self._replies, answers = os.open(replies, os.O_RDWR | os.O_CLOEXEC), -1
        os.set_blocking(self._requests, False)
        os.set_blocking(self._replies, False)
        self._life: int | None = None
        places = {0: theirs, 1: output, 2: output, 3: answers, 4: shared, 5: end_of_line.fileno()}
        try:
            self.pid = _spawn(command, environment, places)
        except BaseException:
            self._close()
            raise
        finally:
            end_of_line.close()
            for descriptor in (theirs, answers):
                if descriptor >= 0:
                    os.close(descriptor)
        with contextlib.suppress(OSError):  # it has ended already
            self._line.sendall(policy)
        self.replies_place = str(replies or "")
        self._life = open_life(self.pid)
        self._waiting = select.poll()
        for watched in (self._replies, self._life):
            if watched is not None:
                self._waiting.register(watched, select.POLLIN)
        self._code: int | None = None
        self._lock = threading.Lock()

    def send(self, data: bytes, seconds: float) -> None:
        """Send a request.

        Raises:
            ConnectionError: if the program does not read it, or not within this time.
        """
        left, until = memoryview(data), time.monotonic() + seconds
        while left:
            try:
                left = left[os.write(self._requests, left) :]
            except BlockingIOError:
                waiting = select.poll()
                waiting.register(self._requests, select.POLLOUT)
                if not waiting.poll(max(0.0, until - time.monotonic()) * 1e3):
                    raise ConnectionError("the program does not read its requests") from None

    def receive_now(self, most: int) -> bytes:
        """Return at most this many bytes of replies that are there; none if the program has closed its end.

        Raises:
            BlockingIOError: if nothing is there.
        """
        return os.read(self._replies, most)

    def wait(self, seconds: float) -> bool:
        """Wait until there is something to receive; return False if the program has ended instead.

        Raises:
            TimeoutError: if neither happens in this time.
        """
        ready = [descriptor for descriptor, _ in self._waiting.poll(seconds * 1e3)]
        if not ready:
            raise TimeoutError
        return self._replies in ready

    def ends_within(self, seconds: float) -> bool:
        """Whether the program ends by itself within this time."""
        until = time.monotonic() + seconds
        if self._life is not None:
            waiting = select.poll()
            waiting.register(self._life, select.POLLIN)
            waiting.poll(seconds * 1e3)
        while self.is_alive:
            if time.monotonic() > until:
                return False
            time.sleep(0.0005)
        return True

    @property
    def is_alive(self) -> bool:
        """Whether the program is running."""
        if self._code is None:
            try:
                return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG) is None
            except ChildProcessError:
                pass
        return False

    def stop(self) -> None:
        """Let the program be ended while another thread waits for it."""
        with self._lock:
            if self._code is None:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self.pid, signal.SIGTERM)

    def told(self) -> bytes:
        """Return what the process that watches the program has told since the last call."""
        try:
            return self._line.recv(_MOST_TOLD, socket.MSG_DONTWAIT)
        except OSError:
            return b""

    def end(self) -> int:
        """End the program and what it has started; return its exit code, negative for a signal.

        A program that has already ended keeps its own exit code.
        """
        self.stop()
        if not self.ends_within(_ENDING_SECONDS):
            kill(self.pid)
        code = self._reap(0)
        self._close()
        return code or 0

    def forget(self) -> None:
        """Leave the program to another process, of which this is a copy."""
        self._code = 0
        self._close()

    def _reap(self, options: int) -> int | None:
        with self._lock:
            if self._code is None:
                try:
                    pid, status = os.waitpid(self.pid, options)
                except ChildProcessError:  # somebody else has waited for it
                    pid, status = self.pid, 0
                self._code = os.waitstatus_to_exitcode(status) if pid else None
            return self._code

    def _close(self) -> None:
        self._line.close()
        for descriptor in (self._requests, self._replies, self._life):
            if descriptor is not None:
                os.close(descriptor)


def _spawn(command: Sequence[str], environment: Mapping[str, str], places: Mapping[int, int]) -> int:
    """Start a program with these open files by the descriptors that it is to have; return its process id."""
    # Copies above all places, so that none is overwritten before it is copied.
    copies = {
        place: fcntl.fcntl(given, fcntl.F_DUPFD_CLOEXEC, 16) for place, given in places.items() if given >= 0
    }
    try:
        actions = [(os.POSIX_SPAWN_DUP2, copy, place) for place, copy in copies.items()]
        session = {"setsid": True} if sys.platform == "linux" else {"setpgroup": 0}
        return os.posix_spawn(
            command[0], list(command), environment, file_actions=actions, setsigmask=(), **session
        )
    finally:
        for copy in copies.values():
            os.close(copy)


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


def machine_memory() -> int:
    """Return the memory of this machine in bytes; 0 if it is unknown."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def memory_limits() -> dict[str, int]:
    """Return the limits of this process's memory in bytes, by the option of ``ulimit`` that sets them."""
    limits = {"d": resource.RLIMIT_DATA, "v": resource.RLIMIT_AS}
    allowed = {option: resource.getrlimit(limit)[0] for option, limit in limits.items()}
    return {option: most for option, most in allowed.items() if most != resource.RLIM_INFINITY}


def most_memory_used() -> int:
    """Return how much memory this process has used at most, in KiB."""
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return used if sys.platform == "linux" else used >> 10
