"""Files written by several commands: where they may be written, and pictures."""

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from itertools import chain, count
from os.path import realpath
from pathlib import Path
from typing import Any

import click

from falsifier.core.files import file_name, write_whole
from falsifier.core.literals import one_line
from falsifier.errors import FalsifierError, SpecError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.record.files import check_unused, make_folder
from falsifier.views.terminal import warn

# File name extensions of pictures that users name.
PICTURES = (".svg", ".png", ".pdf")
# Which every picture of ours names, as what has drawn it.
DRAWN = b"falsifier"


def check_out(path: Path, *, begins: bytes = b"", holds: bytes = b"", kept: Path | None = None) -> None:
    """Check that writing a file replaces at most one of its kind: one that begins with and holds these bytes.

    An empty one may be, too. Without bytes any other is kept, as users change inputs written for them.

    Raises:
        SpecError: if something else is there, or the file ``kept``, from which is worked.
    """
    if not path.exists():
        return
    if not path.is_file():
        raise SpecError(f"{path} is not a file that can be replaced: choose another name")
    if kept is not None and kept.exists() and path.samefile(kept):
        raise SpecError(f"{path} is the original, which is kept: choose another --out")
    content = path.read_bytes()
    if content and not (begins + holds and content.startswith(begins) and holds in content):
        raise SpecError(f"{path} exists and is kept: choose another name, or delete it")


def made_folder(directory: Path) -> None:
    """Make a folder to write to; JournalError if it has files."""
    check_unused(directory)
    make_folder(directory)


def new_directory(name: str) -> Path:
    """Make a folder in ``runs/``, named by the time, which goes with the command if it is empty.

    Tasks of a job array start at the same moment: only who has made a folder knows that it is nobody else's.
    """
    base = Path("runs") / f"{file_name(name)}-{datetime.now():%Y%m%d-%H%M%S}"
    is_first = not base.parent.exists()
    make_folder(base.parent)
    for place in chain([base], (base.with_name(f"{base.name}-{i}") for i in count(2))):
        with suppress(FileExistsError):
            place.mkdir(parents=True)  # another task that ends may just have removed ``runs/``
            break

    def tidy() -> None:
        with suppress(OSError):
            place.rmdir()
            if is_first:
                place.parent.rmdir()

    click.get_current_context().call_on_close(tidy)
    return place


def checked_picture(path: Path) -> Path:
    """Return the path of a picture to write.

    Raises:
        SpecError: if its ending states no format that can be drawn, its folder does not exist, or it exists
            and was not drawn here.
    """
    check_ending(path, PICTURES)
    check_out(path, holds=DRAWN)
    return in_existing_folder(path)


def check_ending(path: Path, endings: tuple[str, ...]) -> None:
    """Refuse a name that promises another kind of file; SpecError naming the endings that are right."""
    if path.suffix.lower() not in endings:
        raise SpecError(f"{path}: expected a file name that ends in {', '.join(endings)}")


def in_existing_folder(path: Path) -> Path:
    """Return the path of a file to write, to which a link leads; SpecError if its folder does not exist."""
    path = Path(realpath(path)) if path.is_symlink() else path
    if not path.parent.is_dir():
        raise SpecError(f"{path}: no such folder {path.parent}: choose another place, or make it first")
    return path


def saved(file: Path, write: Callable[[Path], object]) -> list[Path]:
    """Write a file of what was computed; return its path, or none and a message if that fails."""
    try:
        write(file)
    except (OSError, FalsifierError) as error:
        warn(f"falsifier: {file} cannot be written: {_why(error)}")
        return []
    return [file]


def write_named(file: Path, text: str) -> None:
    """Write a file or stream that users named, and say so; OSError naming it, and nothing remains of it."""
    if file.is_file() or not file.exists():
        write_whole(Path(realpath(file)), text)  # a link is followed, not replaced
    else:
        file.write_text(text, encoding="utf-8")
    warn(f"{file} written")


def draw_evaluation(problem: Problem, evaluation: Evaluation, picture: Path) -> list[Path]:
    """Write the picture of an evaluation with its trajectory; see ``draw``."""
    from falsifier.views.plotting import plot_evaluation

    return draw(lambda: plot_evaluation(problem, evaluation), picture)


def draw(plot: Callable[[], Any], picture: Path) -> list[Path]:
    """Write what ``plot`` returns, a figure; return its path.

    No path if it cannot be drawn or written, which is said on stderr.
    """
    from falsifier.views.plotting import save_figure

    try:
        save_figure(plot(), picture)
    except Exception as error:  # whatever a drawing library thinks of values and names that others chose
        warn(f"falsifier: the picture {picture} cannot be drawn: {_why(error)}")
        return []
    return [picture]


def _why(error: Exception) -> str:
    told = error.strerror if isinstance(error, OSError) else None
    return one_line(told or str(error))
