"""What users of this machine have named: servers of language models, and Python modules that make problems.

Records of runs, campaigns and counterexamples repeat it, and may be somebody else's: what their author has
named, whoever continues or replays them has not. A server would get prompts and a key, and a module would
run.
"""

from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from falsifier.core.files import cache_directory


def note(what: str) -> None:
    """Note that the user has named this, unless the cache cannot be written to."""
    with suppress(OSError, RuntimeError):  # RuntimeError: the user has no home
        place = _place(what)
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        place.touch()


def is_noted(what: str) -> bool:
    """Whether the user has named this before."""
    with suppress(OSError, RuntimeError):
        return _place(what).exists()
    return False


def unnamed(naming: str) -> str:
    """Say that nobody has named it, where that would be noted, and what names it."""
    folder = "the cache of a user with a home"
    with suppress(RuntimeError):
        folder = str(_place("").parent)
    return (
        f"nobody has named on this machine (noted in {folder}: set XDG_CACHE_HOME if nothing can be kept "
        f"there); if you trust it, name it first: {naming}"
    )


def _place(what: str) -> Path:
    return cache_directory() / "named" / sha256(what.encode("utf-8", "surrogatepass")).hexdigest()
