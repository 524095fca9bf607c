"""Services that only Linux has: processes kept apart, descendants found, children that end with their parent.

On macOS each function does nothing, and those that can tell so do.
"""

import contextlib
import ctypes
import os
import select
import signal
import struct
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from subprocess import PIPE, Popen
from typing import NoReturn

assert sys.platform != "win32"

_IS_LINUX = sys.platform == "linux"

_SET_PARENT_DEATH_SIGNAL, _SET_DUMPABLE, _SET_CHILD_SUBREAPER, _SET_NO_NEW_PRIVILEGES = 1, 4, 36, 38
# System calls and constants of Landlock, the same on all architectures (linux/landlock.h).
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _RULE_PATH_BENEATH = 1, 1
_OPEN_PATH = 0o10000000  # O_PATH of Linux
_MOVE_BETWEEN_FOLDERS, _SCOPE_SIGNAL = 1 << 13, 1 << 1
_VERSION_WITH_MOVES, _VERSION_WITH_SIGNALS = 2, 6
# What lets root read the memory of other processes: SYS_MODULE, SYS_RAWIO, SYS_PTRACE, SYS_ADMIN, PERFMON,
# BPF, CHECKPOINT_RESTORE.
_READING_CAPABILITIES = sum(1 << number for number in (16, 17, 19, 21, 38, 39, 40))
_CAPABILITY_VERSION = 0x20080522
# Processes that fork faster than they are killed are left after this time.
_SWEEPING_SECONDS = 2.0


def hide_memory() -> None:
    """Keep other processes of the same user from reading this one's memory and environment (Linux).

    Debuggers cannot attach then, and there are no core dumps. Programs that this one starts are not affected.
    """
    _control(_SET_DUMPABLE, 0)


def confine() -> bool:
    """Keep this process and what it starts from reading and signalling other processes (Linux with Landlock).

    Files and the network stay as they are.

    Returns:
        Whether the system supports it.
    """
    if not _IS_LINUX:
        return False
    # Required by Landlock; also, programs that are started later gain no privileges.
    _control(_SET_NO_NEW_PRIVILEGES, 1)
    with contextlib.suppress(OSError, AttributeError):
        _drop_capabilities()
    try:
        _enter_landlock()
    except OSError:
        return False
    return True


def can_confine() -> bool:
    """Whether ``confine`` separates processes on this system."""
    try:
        return _IS_LINUX and _landlock_version() >= _VERSION_WITH_MOVES
    except OSError:
        return False


def adopt_orphans() -> None:
    """Become the parent of all descendants whose own parent ends, so that they can be found (Linux)."""
    _control(_SET_CHILD_SUBREAPER, 1)


def end_with_parent(parent: int) -> None:
    """Kill this process when its parent ends (Linux)."""
    _control(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)


def end_descendants(keep: Collection[int] = ()) -> None:
    """Kill everything that descends from this process, and wait for it (Linux); see adopt_orphans.

    Args:
        keep: ids of children that stay, with what descends from them.
    """
    until = time.monotonic() + _SWEEPING_SECONDS
    while strays := [pid for pid in children() if pid not in keep]:
        for pid in strays:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        for pid in strays:
            with contextlib.suppress(OSError):
                os.waitpid(pid, os.WNOHANG)
        if time.monotonic() > until:
            return
        time.sleep(0.0005)


def end_descendants_of(pid: int) -> None:
    """Kill everything that descends from another process (Linux); see adopt_orphans."""
    until = time.monotonic() + _SWEEPING_SECONDS
    while time.monotonic() < until:
        found = _descendants(pid)
        if not found:
            return
        for descendant in found:
            with contextlib.suppress(OSError):
                os.kill(descendant, signal.SIGKILL)
        time.sleep(0.0005)


def end_marked(name: str, value: str) -> None:
    """Kill all processes that were started with this variable in their environment (Linux).

    So orphans are found whose ancestors have ended, in any process group.
    """
    mark = f"{name}={value}".encode()
    until = time.monotonic() + _SWEEPING_SECONDS
    while _IS_LINUX and time.monotonic() < until:
        found = [pid for pid, _, _ in _all_processes() if mark in _environment(pid)]
        if not found:
            return
        for pid in found:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.0005)


def open_pipe(path: Path) -> int:
    """Make a named pipe for other programs to write to; return a descriptor that is read without waiting."""
    os.mkfifo(path, 0o600)
    return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)


def start_holding(command: Sequence[str], environment: Mapping[str, str], held: int) -> Popen[bytes]:
    """Start a program, with a pipe to it, that holds a descriptor of this process open as long as it runs."""
    return Popen(command, stdin=PIPE, env=environment, bufsize=0, pass_fds=[held])


def wait_for_any(descriptors: Iterable[int], seconds: float | None = None) -> None:
    """Wait until one of some descriptors can be read, or for this time."""
    waiting = select.poll()
    for descriptor in descriptors:
        waiting.register(descriptor, select.POLLIN)
    waiting.poll(None if seconds is None else seconds * 1e3)


def close_others(kept: int) -> None:
    """Close all descriptors of this process except the standard ones and one more."""
    os.closerange(3, kept)
    os.closerange(kept + 1, os.sysconf("SC_OPEN_MAX"))


def end_by(number: int) -> None:
    """Send this process a signal."""
    os.kill(os.getpid(), number)


def await_end(pid: int) -> int:
    """Wait until a child ends; return how, as the system says it."""
    return os.waitpid(pid, 0)[1]


def end_like(status: int) -> NoReturn:
    """End this process as another has ended; ``status``: see ``await_end``."""
    if os.WIFSIGNALED(status):
        with contextlib.suppress(OSError):  # that of SIGKILL cannot be changed
            signal.signal(os.WTERMSIG(status), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(status))
    os._exit(os.WEXITSTATUS(status))


def children() -> list[int]:
    """Return the process ids of this process's children, adopted ones included (Linux; else none)."""
    if not _IS_LINUX:
        return []
    me = os.getpid()
    try:
        return [int(pid) for pid in Path(f"/proc/{me}/task/{me}/children").read_text().split()]
    except OSError:  # a kernel without this file
        return [pid for pid, parent, _ in _all_processes() if parent == me]


def _control(option: int, value: int) -> None:
    if _IS_LINUX:
        unused = ctypes.c_ulong(0)
        ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value), unused, unused, unused)


def _enter_landlock() -> None:
    """Enter a domain that allows all file accesses: processes outside it are out of reach all the same."""
    version = _landlock_version()
    if version < _VERSION_WITH_MOVES:
        raise OSError("this Landlock would forbid moving files between folders")
    scope = _SCOPE_SIGNAL if version >= _VERSION_WITH_SIGNALS else 0
    # Of the three fields, older kernels know only those that they need here; they accept the others as zeros.
    attributes = struct.pack("=QQQ", _MOVE_BETWEEN_FOLDERS, 0, scope)
    rules = _system_call(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), 0)
    try:
        everything = os.open("/", _OPEN_PATH | os.O_CLOEXEC)
        try:
            rule = struct.pack("=Qi", _MOVE_BETWEEN_FOLDERS, everything)
            _system_call(_ADD_RULE, rules, _RULE_PATH_BENEATH, rule, 0)
        finally:
            os.close(everything)
        _system_call(_RESTRICT_SELF, rules, 0)
    finally:
        os.close(rules)


def _landlock_version() -> int:
    return _system_call(_CREATE_RULESET, None, ctypes.c_size_t(0), _ASK_VERSION)


def _drop_capabilities() -> None:
    """Give up what lets root read the memory of other processes; no effect for other users."""
    libc = ctypes.CDLL(None)
    header = ctypes.create_string_buffer(struct.pack("=Ii", _CAPABILITY_VERSION, 0), 8)
    sets = ctypes.create_string_buffer(24)
    if libc.capget(header, sets):
        return
    kept = [~_READING_CAPABILITIES & 0xFFFFFFFF] * 3 + [~_READING_CAPABILITIES >> 32 & 0xFFFFFFFF] * 3
    held = struct.unpack("=6I", sets.raw)
    libc.capset(header, struct.pack("=6I", *(a & b for a, b in zip(held, kept, strict=True))))


def _system_call(*arguments: object) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    found = int(libc.syscall(*arguments))
    if found < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return found


def _descendants(pid: int) -> list[int]:
    """Process ids of all living descendants of a process; none except on Linux."""
    parents = (
        {child: parent for child, parent, state in _all_processes() if state != "Z"} if _IS_LINUX else {}
    )
    found = {pid}
    while grown := {child for child, parent in parents.items() if parent in found} - found:
        found |= grown
    return list(found - {pid})


def _environment(pid: int) -> list[bytes]:
    """Variables with which a process was started; none if it has ended or belongs to another user."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []


def _all_processes() -> Iterator[tuple[int, int, str]]:
    """Process ids, those of the parents, and states."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, ValueError, IndexError):
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
                yield int(entry.name), int(fields[1]), fields[0]
