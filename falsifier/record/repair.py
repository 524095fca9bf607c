"""Damaged run directories: what is damaged is dropped, and kept beside."""

from pathlib import Path
from shutil import copy2

from falsifier.core.words import counted
from falsifier.errors import JournalError
from falsifier.record import files, manifest
from falsifier.record.journal import JournalReader, run_lock


def repair(directory: Path) -> list[str]:
    """Drop what is damaged in a run directory; return what was found, in words; empty if nothing was.

    Of a journal, what stands before the damage is kept, as after a crash at that moment: ``resume`` simulates
    the rest again with the same result, and asks for the replies of a language model again. A copy of every
    file that is changed is kept beside it.

    Raises:
        JournalError: if the manifest is damaged, which nothing can replace, or a process writes here.
    """
    manifest.read(directory)
    found = []
    with run_lock(directory):
        reader = JournalReader(directory)
        try:
            for _ in reader.new():
                pass
        except JournalError as error:
            path = reader.path
            lost = path.read_bytes()[reader.offset :].count(b"\n")
            copy = Path(copy2(path, files.free_name(path)))
            with path.open("r+b") as file:
                file.truncate(reader.offset)
            found.append(
                f"{path}: line {reader.line + 1} is damaged: {error.__cause__}; {counted(lost, 'line')} from "
                f"there on dropped, kept as {copy.name}; to resume the run repeats what is missing"
            )
        for path in sorted((directory / files.TRAJECTORIES).glob("*.npz")):
            if not (files.is_own_file(path) and files.is_intact(path, path.read_bytes())):
                kept = files.set_aside(path).name
                found.append(f"{path}: damaged; kept as {kept}, simulated again if needed")
    return found
