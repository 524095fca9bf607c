"""Processes, connections and memory on Linux and macOS; each function does as much as the system offers."""

import contextlib
import ctypes
import fcntl
import os
import resource
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType

from falsifier.errors import MachineError

_SET_DUMPABLE = 4
# The system call of Landlock and what it is asked (linux/landlock.h), the same on all architectures.
_CREATE_RULESET, _ASK_VERSION, _VERSION_WITH_MOVES = 444, 1, 2
# A program's end is waited for at most this long; then the process that watches it is killed.
_ENDING_SECONDS = 5.0
_MOST_TOLD = 1 << 16
# Below these limits of memory, in bytes, libraries of linear algebra end the process, with exit code 1, or
# wait for ever; by the option of ``ulimit`` that sets them.
_LEAST_MEMORY = {"d": (resource.RLIMIT_DATA, 300 << 20), "v": (resource.RLIMIT_AS, 500 << 20)}


class WatchedProgram:
    """A program that answers requests, and the process that watches it, which is the one that is started.

    It has the requests on descriptor 0, prints to 1 and 2, and sends its replies to 3; 4 is shared memory. It
    ends with all that it has started, and the process that watches it ends in the same way; 5 is the line to
    that one.

    Args:
        command: program and arguments; the path of the program is absolute.
        environment: its environment.
        output: descriptor of a file for what it prints.
        rights: what the process that watches it is told.
        shared: descriptor of memory that it shares.
        replies: path of a named pipe for its replies, which is made here; None: they come from descriptor 3.
    """

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        output: int,
        rights: bytes,
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
            self.pid = _spawn(command, environment, places)  # its process id
        except BaseException:
            self._close()
            raise
        finally:
            end_of_line.close()
            for descriptor in (theirs, answers):
                if descriptor >= 0:
                    os.close(descriptor)
        with contextlib.suppress(OSError):  # it has ended already
            self._line.sendall(rights)
        self._life = _open_life(self.pid)
        self._waiting = select.poll()
        for watched in (self._replies, self._life):
            if watched is not None:
                self._waiting.register(watched, select.POLLIN)
        self._code: int | None = None
        self._lock = threading.Lock()

    def send(self, data: bytes, seconds: float) -> None:
        """Send a request; ConnectionError if the program does not read it, or not within this time."""
        left, until = memoryview(data), time.monotonic() + seconds
        while left:
            try:
                left = left[os.write(self._requests, left) :]
            except BlockingIOError:
                waiting = select.poll()
                waiting.register(self._requests, select.POLLOUT)
                if not waiting.poll(max(0.0, until - time.monotonic()) * 1e3):
                    raise ConnectionError("the program does not read its requests") from None

    def read(self, most: int, seconds: float, polling: float = 0.0) -> bytes:
        """Wait for replies; return at most this many bytes, none if it has ended or closed its end.

        For ``polling`` s it polls at first, yielding to other processes.

        Raises:
            TimeoutError: if nothing arrives in this time.
        """
        until = time.perf_counter() + polling
        while True:
            try:
                return os.read(self._replies, most)
            except BlockingIOError:
                if time.perf_counter() < until:
                    os.sched_yield()
                    continue
            ready = [descriptor for descriptor, _ in self._waiting.poll(max(0.0, seconds) * 1e3)]
            if not ready:
                raise TimeoutError
            if self._replies not in ready:
                return b""

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
        return self._reap(os.WNOHANG) is None

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
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)
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


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Complete a short step before Ctrl-C, or the end of a job, takes effect; a second Ctrl-C does at once.

    This costs about 0.1 ms, half of a short simulation.
    """
    is_over, held = False, list[int]()
    handlers: dict[int, Callable[[int, FrameType | None], object]] = {}

    def hold(number: int, frame: FrameType | None) -> None:
        # Only Ctrl-C is pressed twice by the impatient: ``timeout`` sends its signal twice in any case.
        if is_over or (number == signal.SIGINT and number in held):
            held.clear()
            handlers[number](number, frame)
        else:
            held.append(number)

    is_main = threading.current_thread() is threading.main_thread()
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if is_main else ():
            if callable(handler := signal.getsignal(number)):
                handlers[number] = handler
                signal.signal(number, hold)
        yield
    finally:
        is_over = True
        for held_back, handler in handlers.items():
            signal.signal(held_back, handler)
        for each in held:
            handlers[each](each, None)


def _spawn(command: Sequence[str], environment: Mapping[str, str], places: Mapping[int, int]) -> int:
    """Start a program with these open files by the descriptors that it is to have; return its process id."""
    # Copies above all places, so that none is overwritten before it is copied.
    above = max(places) + 1
    copies = {to: fcntl.fcntl(one, fcntl.F_DUPFD_CLOEXEC, above) for to, one in places.items() if one >= 0}
    try:
        actions = [(os.POSIX_SPAWN_DUP2, copy, place) for place, copy in copies.items()]
        session = {"setsid": True} if sys.platform == "linux" else {"setpgroup": 0}
        return os.posix_spawn(
            command[0], list(command), environment, file_actions=actions, setsigmask=(), **session
        )
    finally:
        for copy in copies.values():
            os.close(copy)


def hide_memory() -> None:
    """Keep other processes of the same user from reading this one's memory and environment (Linux).

    Debuggers cannot attach then, and there are no core dumps. Programs that this one starts are not affected.
    """
    if sys.platform == "linux":
        unused = ctypes.c_ulong(0)
        ctypes.CDLL(None).prctl(_SET_DUMPABLE, unused, unused, unused, unused)


def can_confine() -> bool:
    """Whether this system's Landlock can keep processes apart and files unchanged (Linux)."""
    if sys.platform != "linux":
        return False
    version = ctypes.CDLL(None).syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _ASK_VERSION)
    return int(version) >= _VERSION_WITH_MOVES


def _open_life(pid: int) -> int | None:
    """Open a descriptor that becomes readable when a process ends; None where there is none (not Linux)."""
    if sys.platform == "linux" and hasattr(os, "pidfd_open"):
        with contextlib.suppress(OSError):
            return os.pidfd_open(pid)
    return None


def exit_text(code: int) -> str:
    """Describe the end of a process by its exit code, which is negative for a signal."""
    if code >= 0:
        return f"it exited with code {code}"
    try:
        return f"signal {signal.Signals(-code).name}"
    except ValueError:
        return f"signal {-code}"


def machine_memory() -> int:
    """Return the memory of this machine in bytes."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def check_memory_limits() -> None:
    """Check that a process may use the memory its libraries need; MachineError: how to raise the limit."""
    for option, (limit, least) in _LEAST_MEMORY.items():
        allowed = resource.getrlimit(limit)[0]
        if allowed != resource.RLIM_INFINITY and allowed < least:
            raise MachineError(
                f"processes may use {allowed >> 20} MiB of memory (ulimit -{option}); simulations need at "
                f"least {least >> 20} MiB: raise it with ulimit -{option} {least >> 10}"
            )
