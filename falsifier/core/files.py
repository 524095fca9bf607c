"""Files: written whole or not at all, and those that come with the package."""

import os
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file in one step, so that a crash leaves the whole of it or none; return its path.

    Missing folders are made; the content is on disk when this returns.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    with partial.open("wb") as file:
        file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
    return path


def bundled(folder: str) -> Path:
    """Folder ``specs`` or ``fmus`` that came with the package: inside it, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / folder
    return inside if inside.is_dir() else package.parent / folder
