"""Files written by several commands: a counterexample as JSON, and its picture."""

from pathlib import Path

from falsifier.counterexamples.store import FILE_NAME, save, to_store
from falsifier.evaluation.confirm import Confirmation


def write_counterexample(confirmation: Confirmation, directory: Path, *, name: str = FILE_NAME) -> list[Path]:
    """Write a counterexample as JSON for ``falsifier replay`` and as a picture; return both paths.

    Args:
        confirmation: the violation.
        directory: where to write.
        name: name of the JSON file; the picture has the same name, with the extension .png.
    """
    from falsifier.views.plotting import plot_evaluation, save_figure

    data = save(to_store(confirmation), directory / name)
    picture = data.with_suffix(".png")
    save_figure(plot_evaluation(confirmation.problem, confirmation.evaluation), picture)
    return [data, picture]
