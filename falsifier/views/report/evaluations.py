"""Every evaluation of runs as a table in a file: what was tried, and what came of it."""

import csv
from collections.abc import Iterable
from pathlib import Path

from falsifier.campaigns.analysis import Run, load
from falsifier.core.literals import csv_cell
from falsifier.errors import SpecError
from falsifier.search.result import Columns, frame


def evaluations(runs: Iterable[Run]) -> Columns:
    """Return one row per evaluation: requirement, method and seed of its run, then what Run.columns gives.

    What a run did not search is None in its rows.

    Raises:
        JournalError: if a record is damaged.
    """
    named = [(run, run.columns()) for run in runs]
    names = dict.fromkeys(name for _, columns in named for name in columns)
    table: Columns = {name: [] for name in ("requirement", "method", "seed", *names)}
    for run, columns in named:
        count = len(columns["simulation"])
        about = {"requirement": run.requirement, "method": run.method.label, "seed": run.seed}
        for name, values in table.items():
            values += [about[name]] * count if name in about else columns.get(name, [None] * count)
    return table


def write_evaluations(directories: Iterable[Path], *, csv_file: Path | None, parquet: Path | None) -> None:
    """Write every evaluation of runs or campaigns.

    Args:
        directories: runs or campaigns.
        csv_file: comma-separated values to write; cells without a value are empty.
        parquet: Parquet file to write.

    Raises:
        JournalError: if a directory is neither, or is damaged.
        SpecError: if a package is missing that writes Parquet.
    """
    if csv_file is None and parquet is None:
        return
    table = evaluations(run for directory in directories for run in load(directory))
    if csv_file is not None:
        with csv_file.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(map(csv_cell, table))
            for row in zip(*table.values(), strict=True):
                writer.writerow("" if value is None else csv_cell(str(value)) for value in row)
    if parquet is not None:
        try:
            frame(table).to_parquet(parquet)
        except ImportError:
            raise SpecError("a Parquet file needs pyarrow: pip install 'falsifier[frames]'") from None
