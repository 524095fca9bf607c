"""A worker's process with its files: the memory that it shares, its output, and the configuration of Wine."""

import filecmp
import os
import re
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.core import posix, posix_files
from falsifier.core.literals import printable
from falsifier.errors import ModelError, remedy
from falsifier.fmu.description.archive import OLD_PLATFORMS, this_platform
from falsifier.fmu.description.libraries import HOW_TO_INSTALL, find_wine, windows_path
from falsifier.fmu.process.rights import Rights, encoded, hidden_places
from falsifier.fmu.process.workplace import Workplace, worker_environment

# Share of the machine's memory that one worker may allocate; beyond it, allocations fail inside the FMU.
_MEMORY_SHARE = 0.8
# Positions in the header of the memory, as in ``enum header`` of worker.h.
RUNNING, SIMULATED, COMPLETE = 0, 1, 2
_MOST_BYTES = 1 << 20
# The end of long output says most about what went wrong.
_SHOWN_BYTES = 64 << 10
_DROPPED = "(further output was dropped)"
# What Wine would start besides the worker, or ask the user to install.
_OVERRIDES = "wineboot.exe,services.exe,explorer.exe,winemenubuilder.exe,mscoree,mshtml="
# What PythonFMU puts into FMUs that call the Python of the process that loads them; there are FMUs of FMUs.
_WRITTEN_IN_PYTHON = ("*/resources/slavemodule.txt", "*/resources/*/resources/slavemodule.txt")
# The folders in which the system looks first for the libraries that a library needs.
_LIBRARY_PATH = "LD_LIBRARY_PATH"
# A process that may start no other one, or open no more files, ends with this code (guard.c).
_CANNOT_START, _LIMITED = 71, "; end other processes, or raise the limits (ulimit -u, ulimit -n)"
# The parts of the system's C library, which fit no other version of it.
_OF_C_LIBRARY = re.compile(
    r"(ld-.+|lib(c|m|mvec|dl|rt|util|pthread|thread_db|anl|resolv|BrokenLocale|nss_\w+))\.so\.\d+|libnsl\.so\.1"
)
# Exceptions of Windows by the signals that the same mistakes have elsewhere.
_SIGNALS = {
    0xC0000005: signal.SIGSEGV,  # access violation
    0xC00000FD: signal.SIGSEGV,  # stack overflow
    0xC000001D: signal.SIGILL,
    0xC0000094: signal.SIGFPE,  # integer division by zero
    0xC0000374: signal.SIGABRT,  # damaged heap
}


class Memory:
    """Float64 values that this process and a worker share; they can become more.

    The worker maps the file that they are in. This process writes and reads it: a process dies that maps a
    file which another one shortens.

    Args:
        path: of the file, for a worker that cannot get a descriptor; None: it has no name.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.file = posix_files.unnamed_file() if path is None else path.open("x+b", buffering=0)
        self._count = 0

    def fit(self, count: int) -> None:
        """Make room for at least this many values; OSError if there is none, or files may not be so large."""
        if count > self._count:
            posix_files.enlarge(self.file, 8 * count)
            self._count = count

    def write(self, values: NDArray[np.float64], position: int) -> None:
        """Let the worker see these values."""
        os.pwrite(self.file.fileno(), values.data, 8 * position)

    def read(self, values: NDArray[np.float64], position: int) -> None:
        """Fill an array, shape (n,), with what the worker has written; with NaN if the file has shrunk."""
        self.file.seek(8 * position)
        left = values.view(np.uint8).data
        while left and (count := self.file.readinto(left)):
            left = left[count:]
        if left:
            values[:] = np.nan

    def header(self, position: int) -> float:
        """Return a number of the header, as the worker says; it may be anything."""
        value = np.zeros(1)
        if not self.file.closed:
            self.read(value, position)
        return float(value[0])


class Output:
    """A file for a process's output, with a position that it shares with this process."""

    def __init__(self) -> None:
        self.file = posix_files.sealed_file(_MOST_BYTES)

    def take(self, until: int | None = None) -> tuple[str, ...]:
        """Return the lines printed since the last call; only the last of much output.

        Args:
            until: position where they end, if the process goes on printing; it may say anything.
        """
        descriptor = self.file.fileno()
        position = os.lseek(descriptor, 0, os.SEEK_CUR)
        if not position:
            return ()
        # The process may have moved the position, which would otherwise be the number of bytes.
        size = min(position, _MOST_BYTES if until is None else until, _MOST_BYTES)
        text = os.pread(descriptor, min(size, _SHOWN_BYTES), max(0, size - _SHOWN_BYTES))
        os.lseek(descriptor, 0, os.SEEK_SET)
        lines = tuple(printable(text.decode("utf-8", "replace")).splitlines())
        return lines if size < _MOST_BYTES else (*lines, _DROPPED)


class Started:
    """A worker's process with what belongs to it, for FMUs that were unpacked to a folder.

    Raises:
        ModelError: if there is no program for this machine, or it cannot be started.
    """

    def __init__(self, workplace: Workplace, folder: Path, rights: Rights, *, through_wine: bool) -> None:
        path = workplace.program()
        command: tuple[str, ...] = ()
        if through_wine:
            command = (str(find_wine()), windows_path(workplace.program(windows=True)))
        self._scratch = scratch = workplace.scratch()
        self._through_wine = through_wine
        self._code: int | None = None
        self.exception: int | None = None  # of Windows, which has ended it, if it has told one
        self.output = Output()  # what it prints
        # What it is told: where its replies go and where the memory is. Through Wine it gets no descriptors.
        replies, shared = (scratch / "replies", scratch / "memory") if through_wine else (None, None)
        self.connect, self.place = ("" if each is None else windows_path(each) for each in (replies, shared))
        self.memory = Memory(shared)  # what it shares with this process
        try:
            environment = worker_environment(os.environ, scratch)
            if through_wine:
                _make_prefix(scratch / "prefix")
                environment = _wine_environment(environment, scratch)
            else:
                if any(any(folder.glob(pattern)) for pattern in _WRITTEN_IN_PYTHON):
                    environment = _python_environment(environment)
                environment = _with_libraries(environment, path, folder, scratch / "libraries")
            memory = int(posix.machine_memory() * _MEMORY_SHARE)
            told = encoded(rights, (scratch, folder), _hidden(), memory=memory, command=command)
            self.program = posix.WatchedProgram(
                [str(path)], environment, self.output.file.fileno(), told, self.memory.file.fileno(), replies
            )
        except BaseException as error:
            self._close()
            if isinstance(error, OSError):
                raise ModelError(f"{path} cannot be started: {error}{remedy(error)}") from error
            raise

    def end(self) -> int:
        """End the process and remove its folder; return the exit code, negative for a signal."""
        if self._code is None:
            code, exception = self.program.end(), self.exception
            self._code = code if exception is None else -_SIGNALS.get(exception, -(exception & 0xFF))
            self._close()
        return self._code

    def not_started(self) -> ModelError:
        """End a process that does not answer; return the error that says so."""
        code, needed = self.end(), f"; a Wine for 64-bit programs is needed: {HOW_TO_INSTALL}"
        hint = needed if self._through_wine else _LIMITED if code == _CANNOT_START else ""
        return ModelError(f"the program that runs FMUs does not start ({posix.exit_text(code)}){hint}")

    def _close(self) -> None:
        self.output.file.close()
        self.memory.file.close()
        posix_files.remove_tree(self._scratch)


@lru_cache(maxsize=1)
def _hidden() -> tuple[str, ...]:
    return hidden_places(os.environ, posix_files.homes(), is_root=os.geteuid() == 0)


def _python_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment in which libraries find the Python of this process, and its packages."""
    library = Path(*sysconfig.get_config_vars("LIBDIR", "INSTSONAME"))
    found = {"LD_PRELOAD": str(library if library.is_file() else library.name)}
    folders = (str(Path(sys.executable).parent), environment.get("PATH", os.defpath))
    return {**found, **environment, "PATH": os.pathsep.join(folders)}


def _with_libraries(environment: dict[str, str], program: Path, folder: Path, links: Path) -> dict[str, str]:
    """Return an environment in which FMUs find the libraries beside their own, as in importers elsewhere.

    The process that watches the FMU, which nothing confines, has the same environment. So what the program
    itself needs is never taken from an FMU. The FMUs were unpacked to ``folder``, each to one of its own; the
    folder ``links`` is made for links to their libraries, if there are any.
    """
    libraries, known = _libraries(folder), environment.get(_LIBRARY_PATH)
    # The system's loader reads such a path as several, or replaces names of its own in it.
    if not libraries or not {":", ";", "$"}.isdisjoint(str(links)):
        return environment
    own = _needed(program, frozenset(item for item in environment.items() if item[0].startswith("LD_")))
    if not own:
        return environment
    links.mkdir()
    for file in libraries:
        if file.name not in own:
            (links / file.name).symlink_to(file)
    return {**environment, _LIBRARY_PATH: f"{known}:{links}" if known else str(links)}


@cache
def _libraries(folder: Path) -> tuple[Path, ...]:
    """Return the libraries of FMUs, if any has more than one, as they were before any of the FMUs ran.

    Not those of which two FMUs have different ones, and no part of the C library.
    """
    here = this_platform()
    names = [here, *(old for old, new in OLD_PLATFORMS.items() if new == here)]
    places = [place for name in names for place in folder.glob(f"*/binaries/{name}")]
    found = [[f for f in place.glob("*.so*") if f.is_file() and not f.is_symlink()] for place in places]
    if sys.platform != "linux" or all(len(files) < 2 for files in found):
        return ()
    by_name: dict[str, list[Path]] = {}
    for file in chain.from_iterable(found):
        by_name.setdefault(file.name, []).append(file)
    return tuple(
        first
        for name, (first, *others) in by_name.items()
        if not _OF_C_LIBRARY.fullmatch(name)
        and all(filecmp.cmp(first, other, shallow=False) for other in others)
    )


@lru_cache
def _needed(program: Path, environment: frozenset[tuple[str, str]]) -> frozenset[str]:
    """Return the names of the libraries that a program needs; none where the loader tells none (musl's)."""
    told = {**dict(environment), "LD_TRACE_LOADED_OBJECTS": "1"}
    traced = subprocess.run([program], env=told, stdin=subprocess.DEVNULL, capture_output=True)
    lines = () if traced.returncode else os.fsdecode(traced.stdout).splitlines()
    return frozenset(Path(line.split()[0]).name for line in lines if line.strip())


def _make_prefix(prefix: Path) -> None:
    """Make the least that Wine takes for a Windows installation."""
    (prefix / "drive_c" / "windows" / "system32").mkdir(parents=True)
    drives = prefix / "dosdevices"
    drives.mkdir()
    (drives / "c:").symlink_to("../drive_c")
    (drives / "z:").symlink_to("/")


def _wine_environment(environment: Mapping[str, str], scratch: Path) -> dict[str, str]:
    """Return the environment of Wine, which shares nothing with the user's; it gets no screen."""
    return {
        **environment,
        "WINEPREFIX": str(scratch / "prefix"),
        "WINEARCH": "win64",
        "LC_ALL": "C.UTF-8",  # for the names of files
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": _OVERRIDES,
        # Without an installation, Wine finds its own libraries only in this mode.
        "WINEBOOTSTRAPMODE": "1",
        **dict.fromkeys(("WINETEMP", "WINETMP", "TEMP", "TMP"), windows_path(scratch)),
        **dict.fromkeys(("SystemRoot", "windir"), "C:\\windows"),
    }
