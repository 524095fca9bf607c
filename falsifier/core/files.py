"""Atomic file writes, and the folders bundled with the package."""

import os
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file atomically and return its path.

    A crash leaves either the old file or the complete new one. Missing folders are created; the content is on
    disk when the function returns.
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
    """Return the folder ``specs`` or ``fmus``: bundled with the package, or next to it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / folder
    return inside if inside.is_dir() else package.parent / folder
