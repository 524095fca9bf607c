"""The trajectories of a run directory: each file has its checksum in its name, so that damage is noticed."""

import logging
from functools import cache
from io import BytesIO
from pathlib import Path

from falsifier.core.files import checksum, write_whole
from falsifier.core.trajectory import Trajectory

_LOG = logging.getLogger(__name__)

TRAJECTORIES = "trajectories"
# Names of files that are complete.
TRAJECTORY_NAMES = r"\d+-[0-9a-f]+\.npz"


def save_trajectory(directory: Path, index: int, trajectory: Trajectory) -> str:
    """Write a trajectory to a run directory and force it to disk; return its name for the record."""
    buffer = BytesIO()
    trajectory.save(buffer)
    content = buffer.getvalue()
    name = f"{TRAJECTORIES}/{index}-{checksum(content)}.npz"
    write_whole(directory / name, content)
    return name


def recorded_trajectory(directory: Path, name: str | None) -> Trajectory | None:
    """Load the trajectory of a record; None if it was not kept, or is damaged, of which a warning tells."""
    if name is None:
        return None
    path = directory / name
    try:
        content = path.read_bytes()
    except OSError as error:
        _tell_lost(path, error.strerror or "it cannot be read")
        return None
    if is_intact(path, content):
        return Trajectory.load(BytesIO(content))
    _tell_lost(path, "its checksum does not match")
    return None


@cache
def _tell_lost(path: Path, why: str) -> None:
    """Tell it once, however often a command reads the file."""
    _LOG.warning("%s is damaged: %s. It is left out, or simulated again where it is needed.", path, why)


def is_intact(path: Path, content: bytes) -> bool:
    """Whether the content of a trajectory's file matches the checksum in its name."""
    return path.stem.rpartition("-")[2] == checksum(content)
