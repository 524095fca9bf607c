"""Makes a damaged run directory readable again.

Of a journal, what stands before the damage is kept, as after a crash at that moment: ``resume`` simulates the
rest again with the same result, and asks for the replies of a language model again. A copy of every file that
is changed is kept beside it.
"""

from pathlib import Path
from shutil import copy2

from falsifier.core.words import counted
from falsifier.errors import JournalError
from falsifier.record import manifest
from falsifier.record.files import TRAJECTORIES, is_intact
from falsifier.record.journal import JOURNAL, JournalReader, run_lock


def repair(directory: Path) -> list[str]:
    """Drop what is damaged in a run directory; return what was found, in words; empty if nothing was.

    Raises:
        JournalError: if the manifest is damaged, which nothing can replace, or a process writes here.
    """
    manifest.read(directory)
    with run_lock(directory):
        return [*_repair_journal(directory), *_repair_trajectories(directory / TRAJECTORIES)]


def set_aside(path: Path) -> Path:
    """Rename a damaged file or folder, so that it is kept but no longer read; return its new path."""
    return path.rename(_free(path))


def _free(path: Path) -> Path:
    names = (path.with_name(f"{path.name}.damaged-{i}") for i in range(1, 10_000))
    return next(name for name in names if not name.exists())


def _repair_trajectories(folder: Path) -> list[str]:
    damaged = [path for path in sorted(folder.glob("*.npz")) if not is_intact(path, path.read_bytes())]
    return [f"{path}: damaged; kept as {set_aside(path).name}, simulated again if needed" for path in damaged]


def _repair_journal(directory: Path) -> list[str]:
    path = directory / JOURNAL
    if path.is_dir():
        return [f"{path}: a folder, not a journal; kept as {set_aside(path).name}"]
    reader = JournalReader(directory)
    try:
        for _ in reader.new():
            pass
    except JournalError:
        lost = path.read_bytes()[reader.offset :].count(b"\n")
        copy = Path(copy2(path, _free(path)))
        with path.open("r+b") as file:
            file.truncate(reader.offset)
        return [
            f"{path}: line {reader.line} is damaged: {counted(lost, 'line')} from there on dropped, the "
            f"original is kept as {copy.name}; falsifier resume repeats what is missing"
        ]
    return []
