"""One run as it is sent to a worker, and what the worker does with it.

A worker is a process on this machine or another one. The problem is sent as a value; its FMUs are identified
by their hashes, and their content is sent only if the worker does not have it. A worker that sees the
campaign's directory writes there; otherwise it uses a local folder and sends the finished run back.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir
from threading import Lock
from time import time
from zipfile import ZipFile

from falsifier.campaigns.directory import campaign_mark, run_directory
from falsifier.fmu import fmu_files, with_local_files
from falsifier.problem.problem import Problem
from falsifier.record.journal import STOP
from falsifier.record.manifest import Manifest
from falsifier.record.run import StopFile, carry_out
from falsifier.search.request import RunRequest

# Time in s to wait for a run's lock: the workers of a killed campaign take a moment to end.
_PATIENCE = 10.0

# Time in s for which a run that was sent back is kept.
_KEPT_SECONDS = 86400.0

# A worker carries out one run at a time even if it has several threads: FMUs are loaded once per process.
_ONE_AT_A_TIME = Lock()


@dataclass(frozen=True, slots=True)
class RunTask:
    """One run to carry out.

    Attributes:
        name: name of the run.
        request: what to run.
        problem: the loaded problem.
        manifest: manifest of the run.
        campaign: path of the campaign's directory on the machine that started it.
        mark: hash by which a worker recognises that directory.
    """

    name: str
    request: RunRequest
    problem: Problem
    manifest: Manifest
    campaign: Path
    mark: str


@dataclass(frozen=True, slots=True)
class Missing:
    """The worker needs the file with this SHA-256 first."""

    digest: str


@dataclass(frozen=True, slots=True)
class Done:
    """A run has ended.

    Attributes:
        status: how it ended.
        reason: why, in words.
        packed: the run directory as a ZIP archive, if the worker could not write it in place.
    """

    status: str
    reason: str
    packed: bytes | None = None


def run_task(task: RunTask, files: Mapping[str, bytes]) -> Done | Missing:
    """Carry out one run, or resume it.

    Args:
        task: the run.
        files: contents, by SHA-256, of files that this worker reported missing.
    """
    with _ONE_AT_A_TIME:
        problem = _with_local_fmus(task.problem, files)
        if isinstance(problem, Missing):
            return problem
        in_place = campaign_mark(task.campaign) == task.mark
        campaign = task.campaign if in_place else _store() / "runs" / task.mark
        directory = run_directory(campaign, task.name)
        (result,) = carry_out(
            task.request,
            [problem],
            directory,
            described=task.manifest,
            listeners=[StopFile(campaign / STOP)],
            resume=True,
            patience=_PATIENCE,
        )
        if in_place:
            return Done(result.status, result.reason)
        _sweep(_store())
        # It stays here for a while: if it gets lost on its way, with this worker, it need not be repeated.
        return Done(result.status, result.reason, pack(directory))


def fmu_file(problem: Problem, digest: str) -> Path:
    """Path of the FMU of the problem's model that has this SHA-256."""
    return next(path for path, found in fmu_files(problem.model).items() if found == digest)


def pack(directory: Path) -> bytes:
    """Pack all files of a run directory into a ZIP archive."""
    buffer = BytesIO()
    with ZipFile(buffer, "w") as archive:
        for path in sorted(directory.rglob("*")):
            if path.is_file() and path.name != "lock":
                archive.write(path, path.relative_to(directory))
    return buffer.getvalue()


def unpack(packed: bytes, directory: Path) -> None:
    """Unpack a run directory, replacing what was there; readers never see a half-written directory."""
    partial = directory.with_name(f"{directory.name}.partial")
    rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    with ZipFile(BytesIO(packed)) as archive:
        archive.extractall(partial)
    rmtree(directory, ignore_errors=True)
    partial.rename(directory)


def _sweep(store: Path) -> None:
    """Remove runs in which nothing has been written for long; other workers may be at work here."""
    for directory in store.glob("runs/*/runs/*"):
        with suppress(OSError):  # another worker has just removed or renamed a file
            written = max(path.stat().st_mtime for path in (directory, *directory.rglob("*")))
            if time() - written > _KEPT_SECONDS:
                rmtree(directory, ignore_errors=True)


def _with_local_fmus(problem: Problem, files: Mapping[str, bytes]) -> Problem | Missing:
    """Return the problem with the paths of this worker's copies of the FMUs."""
    local: dict[str, Path] = {}
    for path, digest in fmu_files(problem.model).items():
        if path.is_file() and _digest(path, path.stat().st_mtime_ns) == digest:
            continue
        stored = _store() / "files" / digest / path.name
        if digest in files:
            _put(stored, files[digest])
        if not stored.is_file():
            return Missing(digest)
        local[digest] = stored
    return replace(problem, model=with_local_files(problem.model, local)) if local else problem


@lru_cache(maxsize=256)
def _digest(path: Path, changed: int) -> str:
    """SHA-256 of a file; the modification time is part of the cache's key."""
    return sha256(path.read_bytes()).hexdigest()


def _put(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    partial.write_bytes(content)
    partial.replace(path)


def _store() -> Path:
    """Folder for files sent to this worker: FALSIFIER_STORE, or a temporary folder of this user."""
    fallback = Path(gettempdir()) / f"falsifier-{os.getuid()}"
    return Path(os.environ.get("FALSIFIER_STORE") or fallback)
