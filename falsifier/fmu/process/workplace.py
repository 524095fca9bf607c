"""Where workers run: a folder of this process, unpacked FMUs, the program that runs them, its environment."""

import contextlib
import os
import platform
import re
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from uuid import uuid4

from falsifier.core import posix, posix_files
from falsifier.core.compiler import compile_c
from falsifier.core.files import cache_directory, checksum, private_folder
from falsifier.core.secrets import scrubbed
from falsifier.errors import ModelError
from falsifier.fmu.description.archive import WINDOWS, extract, file_hash, this_platform

_PREFIX = "falsifier-fmu-"
_LOCK_SUFFIX = ".lock"
# Only what this module has made is swept.
_MADE = re.compile(rf"{_PREFIX}[0-9a-f]{{32}}({re.escape(_LOCK_SUFFIX)})?")
# A lock without a folder belongs to a process that is about to make the folder, unless it is older than this.
_MAKING_SECONDS = 3600.0

WORKER = Path(__file__).parents[1] / "worker"
# Platforms whose system calls platform/sandbox_linux.c knows.
_CONFINED = ("x86_64-linux", "aarch64-linux")
_FLAGS = ("-I.", "-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno")
_NOT_HERE = ("windows.c", "sandbox_linux.c", "calls_linux.c", "sandbox_none.c")
# Names of further variables to pass on, separated by commas.
MORE = "FALSIFIER_FMU_VARIABLES"

# Where programs and libraries are, who the user is, language and time zone, and licences.
_PASSED = re.compile(
    r"(PYTHON)?PATH|HOME|USER|LOGNAME|LANG|LANGUAGE|LC_\w+|TZ|LD_LIBRARY_PATH|DYLD_(FALLBACK_)?LIBRARY_PATH"
    r"|\w*LICEN[SC]E\w*",
    re.IGNORECASE,
)


class WorkFolder:
    """A folder in the system's temporary folder, with a lock beside it that says that its owner is alive."""

    def __init__(self) -> None:
        self.path = Path(tempfile.gettempdir()).absolute() / f"{_PREFIX}{uuid4().hex}"
        # Locked before the folder exists: a folder whose lock is free has lost its owner.
        self._lock = posix_files.lock_file(_lock_of(self.path))
        self.path.mkdir(mode=0o700)

    def remove(self) -> None:
        """Remove the folder with all its contents, and the lock."""
        remove_work_folder(self.path)
        self.forget()

    def forget(self) -> None:
        """Leave the folder to another process, such as the one that this is a copy of."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def remove_work_folder(path: Path) -> None:
    """Remove a folder that a WorkFolder made, perhaps in another process, and its lock."""
    posix_files.remove_tree(path)
    with contextlib.suppress(OSError):
        _lock_of(path).unlink()


def sweep() -> None:
    """Remove the folders of processes that were killed before they could do so."""
    temporary = Path(tempfile.gettempdir())
    for path in temporary.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            if not (_MADE.fullmatch(path.name) and path.lstat().st_uid == os.getuid()):
                continue
            if not path.name.endswith(_LOCK_SUFFIX):
                lock = posix_files.lock_file(_lock_of(path))
                if lock is not None:
                    try:
                        remove_work_folder(path)
                    finally:
                        os.close(lock)
            elif not path.with_name(path.name.removesuffix(_LOCK_SUFFIX)).exists():
                age = time.time() - path.lstat().st_mtime
                if age > _MAKING_SECONDS:
                    path.unlink()


def _lock_of(path: Path) -> Path:
    return path.with_name(path.name + _LOCK_SUFFIX)


class Workplace(WorkFolder):
    """The folder of this process's workers and unpacked FMUs; MachineError if memory is too limited."""

    def __init__(self) -> None:
        posix.check_memory_limits()
        _protect_secrets(os.environ)
        sweep()
        super().__init__()
        self._making = threading.Lock()

    def unpacked(self, archives: Sequence[tuple[Path, str]]) -> Path:
        """Return the folder to which FMUs are unpacked, each to its number; unpack them if necessary.

        Two components with the same FMU get a folder each: a library that is loaded from two files has its
        static data twice.

        Raises:
            ModelError: if a file has changed since the model was loaded, or cannot be unpacked.
        """
        folder = self.path / checksum("".join(sha for _, sha in archives).encode())
        with self._making:
            if not folder.is_dir():
                partial = folder.with_suffix(".partial")
                for number, (path, sha) in enumerate(archives):
                    if file_hash(path) != sha:
                        raise ModelError(
                            f"{path}: the file has changed since the model was loaded; load the model again"
                        )
                    extract(path, partial / str(number))
                partial.rename(folder)
        return folder

    def program(self, *, windows: bool = False) -> Path:
        """Return the path of the program that runs FMUs; copy or compile it first if necessary.

        Raises:
            ModelError: if there is none for this machine, or no library can be loaded from the folder.
        """
        if not windows and posix_files.forbids_programs(self.path):
            raise ModelError(
                f"FMUs are unpacked to {self.path.parent}, from which this system loads no libraries "
                "(noexec); set TMPDIR to another folder"
            )
        with self._making:
            return worker_program(self.path, windows=windows)

    def scratch(self) -> Path:
        """Return a new folder for one worker."""
        return Path(tempfile.mkdtemp(prefix="work-", dir=self.path))


def worker_program(root: Path, *, windows: bool = False) -> Path:
    """Return the path of the program that runs FMUs.

    Args:
        root: folder for a copy, if the installed one may not be executed, or a compiled one not be kept.
        windows: whether it is the program for Windows, which is executed by Wine.

    Raises:
        ModelError: if there is none for this machine, and it cannot be compiled either.
    """
    if windows:
        return WORKER / "bin" / WINDOWS / "worker.exe"
    found = this_platform()
    path = WORKER / "bin" / found / "worker"
    if not path.is_file() or not _has_its_library():
        return _compiled(root, found)
    if os.access(path, os.X_OK):
        return path
    copy = root / path.name
    if not copy.exists():
        copy.write_bytes(path.read_bytes())
        copy.chmod(stat.S_IRWXU)
    return copy


@lru_cache(maxsize=1)
def _has_its_library() -> bool:
    """Whether this system has the C library that the built program needs; others are used with musl."""
    return sys.platform != "linux" or platform.libc_ver()[0] == "glibc"


def _compiled(root: Path, found: str) -> Path:
    """Return the program, compiled by this machine's C compiler, once for all processes of this user."""
    path = (_kept() or root) / f"worker-{found}-{_sum_of_sources()}"
    if path.exists():
        return path
    kept = ("sandbox_linux.c", "calls_linux.c") if found in _CONFINED else ("sandbox_none.c",)
    files = [path for path in sorted(WORKER.rglob("*.c")) if path.name in kept or path.name not in _NOT_HERE]
    sources = [str(path.relative_to(WORKER)) for path in files]
    libraries = ("-lm", "-ldl") if found.endswith("-linux") else ("-lm",)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        compile_c(WORKER, WORKER, [*_FLAGS, *sources, *libraries, "-o", str(partial)])
    except ModelError as error:
        raise ModelError(
            f"there is no program to run FMUs on {found}, and it cannot be compiled: {error}"
        ) from None
    partial.replace(path)
    return path


def _kept() -> Path | None:
    """Return the folder where compiled programs are kept; None if there is none from which they may run."""
    try:
        folder = private_folder(cache_directory() / "workers")
    except RuntimeError:  # the user has no home
        return None
    return None if folder is None or posix_files.forbids_programs(folder) else folder


@lru_cache(maxsize=1)
def _sum_of_sources() -> str:
    """Return a checksum of what the program is compiled from, so that no other version's is taken."""
    files = sorted(WORKER.rglob("*.[ch]"))
    return checksum(b"".join(file.read_bytes() for file in files) + " ".join(_FLAGS).encode())


def _protect_secrets(environment: Mapping[str, str]) -> None:
    """Keep FMUs from reading this process's secrets where they are not confined to their own processes.

    On Linux, any process could otherwise read the environment of another one of the same user. Without
    secrets, or if FMUs can be confined, this process stays open to debuggers.
    """
    if scrubbed(environment) != environment and not posix.can_confine():
        posix.hide_memory()


def worker_environment(environment: Mapping[str, str], scratch: Path) -> dict[str, str]:
    """Return the environment of a worker, whose temporary files go to its scratch folder."""
    more = {name.strip() for name in environment.get(MORE, "").split(",")}
    passed = {name: value for name, value in environment.items() if _PASSED.fullmatch(name) or name in more}
    folders = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch))
    # One thread each, because workers run in parallel.
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**scrubbed(passed), **folders, **threads}
