"""The program that runs FMUs, built for the usual platforms and else compiled here, and its environment."""

import os
import platform
import re
import stat
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from falsifier.core import posix, posix_files
from falsifier.core.compiler import compile_c
from falsifier.core.files import cache_directory, checksum, private_folder
from falsifier.core.secrets import holds_secrets, scrubbed
from falsifier.errors import ModelError
from falsifier.fmu.description import WINDOWS, this_platform

WORKER = Path(__file__).parents[1] / "worker"
# Platforms whose system calls sandbox_linux.c knows.
_CONFINED = ("x86_64-linux", "aarch64-linux")
_FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno")
_NOT_HERE = ("platform_windows.c", "sandbox_linux.c", "calls_linux.c", "sandbox_none.c")
# Names of further variables to pass on, separated by commas.
MORE = "FALSIFIER_FMU_VARIABLES"

# Where programs and libraries are, who the user is, language and time zone, and licences.
_PASSED = re.compile(
    r"PATH|HOME|USER|LOGNAME|LANG|LANGUAGE|LC_\w+|TZ|LD_LIBRARY_PATH|DYLD_(FALLBACK_)?LIBRARY_PATH"
    r"|\w*LICEN[SC]E\w*",
    re.IGNORECASE,
)


def worker_program(root: Path, *, windows: bool = False) -> Path:
    """Return the path of the program that runs FMUs.

    Args:
        root: folder for a copy, if the installed one may not be executed, or for one that is compiled and
            cannot be kept.
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
    sources = [p.name for p in sorted(WORKER.glob("*.c")) if p.name in kept or p.name not in _NOT_HERE]
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
    files = sorted((*WORKER.glob("*.c"), *WORKER.glob("*.h")))
    return checksum(b"".join(file.read_bytes() for file in files) + " ".join(_FLAGS).encode())


def protect_secrets(environment: Mapping[str, str]) -> None:
    """Keep FMUs from reading this process's secrets where they are not confined to their own processes.

    On Linux, any process could otherwise read the environment of another one of the same user. Without
    secrets, or if FMUs can be confined, this process stays open to debuggers.
    """
    if holds_secrets(environment) and not posix.can_confine():
        posix.hide_memory()


def worker_environment(environment: Mapping[str, str], scratch: Path) -> dict[str, str]:
    """Return the environment of a worker.

    Args:
        environment: that of this process.
        scratch: the worker's folder, where its temporary files go.
    """
    more = {name.strip() for name in environment.get(MORE, "").split(",")}
    passed = {name: value for name, value in environment.items() if _PASSED.fullmatch(name) or name in more}
    folders = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch))
    # One thread each, because workers run in parallel.
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**scrubbed(passed), **folders, **threads}
