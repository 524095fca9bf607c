"""Starting workers: the folder of this process's workers, unpacked FMUs, and the program that runs them."""

import os
import signal
import tempfile
import threading
import time
from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from falsifier.core import posix, posix_files
from falsifier.errors import ModelError
from falsifier.fmu.description import HOW_TO_INSTALL, extract, file_hash, find_wine, windows_path
from falsifier.fmu.process import folders
from falsifier.fmu.process.encoding import text
from falsifier.fmu.process.program import protect_secrets, worker_environment, worker_program
from falsifier.fmu.process.rights import Policy, encoded, hidden_places, policy_text, read_told
from falsifier.fmu.process.shared import Memory, Output

# Share of the machine's memory that one worker may allocate; beyond it, allocations fail inside the FMU.
_MEMORY_SHARE = 0.8
# A worker has told what is enforced after at most the first; it is looked for after the second.
_SETUP_SECONDS, _LOOKING_SECONDS = 10.0, 0.001
# What Wine would start besides the worker, or ask the user to install.
_OVERRIDES = "wineboot.exe,services.exe,explorer.exe,winemenubuilder.exe,mscoree,mshtml="
# Exceptions of Windows by the signals that the same mistakes have elsewhere.
_SIGNALS = {
    0xC0000005: "SIGSEGV",  # access violation
    0xC00000FD: "SIGSEGV",  # stack overflow
    0xC000001D: "SIGILL",
    0xC0000094: "SIGFPE",  # integer division by zero
    0xC0000374: "SIGABRT",  # damaged heap
}


class Workplace:
    """The folder of this process's workers, and the FMUs that are unpacked to it.

    Raises:
        MachineError: if processes may not use enough memory.
    """

    def __init__(self) -> None:
        posix.check_memory_limits()
        protect_secrets(os.environ)
        folders.sweep()
        self._folder = folders.WorkFolder()
        self._lock = threading.Lock()

    @property
    def root(self) -> Path:
        """The folder."""
        return self._folder.path

    def unpacked(self, archives: Mapping[str, tuple[Path, str]]) -> Path:
        """Return the folder to which FMUs are unpacked; unpack them if necessary.

        Two components with the same FMU get a folder each: a library that is loaded from two files has its
        static data twice.

        Raises:
            ModelError: if a file has changed since the model was loaded, or cannot be unpacked.
        """
        key = sha256(repr([(name, sha) for name, (_, sha) in archives.items()]).encode()).hexdigest()[:16]
        folder = self.root / key
        with self._lock:
            if not folder.is_dir():
                partial = folder.with_suffix(".partial")
                for name, (path, sha) in archives.items():
                    _extract(path, sha, partial / name)
                partial.rename(folder)
        return folder

    def program(self, *, windows: bool = False) -> Path:
        """Return the path of the program that runs FMUs; copy or compile it first if necessary.

        Raises:
            ModelError: if there is none for this machine, or no library can be loaded from the folder.
        """
        if not windows and posix_files.forbids_programs(self.root):
            raise ModelError(
                f"FMUs are unpacked to {self.root.parent}, from which this system loads no libraries "
                "(noexec); set TMPDIR to another folder"
            )
        with self._lock:
            return worker_program(self.root, windows=windows)

    def scratch(self) -> Path:
        """Return a new folder for one worker."""
        return Path(tempfile.mkdtemp(prefix="work-", dir=self.root))

    def remove(self) -> None:
        """Remove the folder."""
        self._folder.remove()

    def forget(self) -> None:
        """Leave the folder to another process, of which this is a copy."""
        self._folder.forget()


class Started:
    """A worker's process with what belongs to it.

    Args:
        workplace: the folder of all workers.
        folder: where its FMUs are.
        policy: what these may do.
        through_wine: whether it is the program for Windows.

    Attributes:
        program: the process.
        output: what it prints.
        memory: what it shares with this process.
        scratch: its folder.

    Raises:
        ModelError: if there is no program for this machine, or Wine is not installed.
    """

    def __init__(self, workplace: Workplace, folder: Path, policy: Policy, *, through_wine: bool) -> None:
        path = workplace.program()
        command: tuple[str, ...] = ()
        if through_wine:
            command = (_wine(), windows_path(workplace.program(windows=True)))
        self.scratch = workplace.scratch()
        self.output = Output()
        environment = worker_environment(os.environ, self.scratch)
        if through_wine:
            _make_prefix(self.scratch / "prefix")
            environment = _wine_environment(environment, self.scratch)
        self._replies = self.scratch / "replies" if through_wine else None
        self.memory = Memory(self.scratch / "memory" if through_wine else None)
        try:
            memory = int(posix.machine_memory() * _MEMORY_SHARE)
            told = encoded(policy, (self.scratch, folder), _hidden(), memory=memory, command=command)
            self.program = posix.Program(
                [str(path)], environment, self.output.fileno(), told, self.memory.fileno(), self._replies
            )
        except BaseException as error:
            self._close()
            if isinstance(error, OSError):
                raise ModelError(f"{path} cannot be started: {error}") from error
            raise

    @property
    def connect(self) -> bytes:
        """What the worker is told first: where its replies go."""
        return text("" if self._replies is None else windows_path(self._replies))

    @property
    def place(self) -> str:
        """What the worker is told of where the memory is."""
        return "" if self.memory.path is None else windows_path(self.memory.path)

    def end(self) -> int:
        """End the process and remove its folder; return the exit code, negative for a signal."""
        code = self.program.end()
        self._close()
        return code

    def forget(self) -> None:
        """Leave the process to another one, of which this is a copy."""
        self.program.forget()

    def _close(self) -> None:
        self.output.close()
        self.memory.close()
        posix_files.remove_tree(self.scratch)


def rights_text(workplace: Workplace, policy: Policy) -> str:
    """Say in one line what FMUs may do, and what this system does not enforce; starts a worker to see that.

    Raises:
        ModelError: if there is no program for this machine.
    """
    told, until = b"", time.monotonic() + _SETUP_SECONDS
    started = Started(workplace, workplace.scratch(), policy, through_wine=False)
    while not told.endswith(b"\0") and time.monotonic() < until:
        told += started.program.told()
        time.sleep(_LOOKING_SECONDS)
    started.end()
    return policy_text(policy, read_told(told).enforced)


def crash_code(exception: int) -> int:
    """Return the exit code that an exception of Windows has elsewhere: minus the number of a signal."""
    name = _SIGNALS.get(exception)
    number = getattr(signal, name, None) if name else None
    return -int(number) if number is not None else exception & 0xFF


@lru_cache(maxsize=1)
def _hidden() -> tuple[str, ...]:
    return hidden_places(os.environ, posix_files.homes(), is_root=os.geteuid() == 0)


def _extract(path: Path, sha: str, folder: Path) -> None:
    if file_hash(path) != sha:
        raise ModelError(f"{path}: the file has changed since the model was loaded; load the model again")
    extract(path, folder)


def _wine() -> str:
    wine = find_wine()
    if wine is None:
        raise ModelError(f"Windows libraries run through Wine, which is missing: {HOW_TO_INSTALL}")
    return str(wine)


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
        "WINETEMP": windows_path(scratch),
        "WINETMP": windows_path(scratch),
        "TEMP": windows_path(scratch),
        "TMP": windows_path(scratch),
        "SystemRoot": "C:\\windows",
        "windir": "C:\\windows",
    }
