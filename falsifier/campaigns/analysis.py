"""The results of runs and campaigns in numbers, read from their directories.

::

    from falsifier.campaigns.analysis import frame, load

    runs = load(Path("runs/nightly"))
    frame(runs).groupby(["requirement", "method"]).simulations.mean()
"""

from falsifier.campaigns.runs import Run, columns, frame, load, load_run, not_begun
from falsifier.campaigns.statistics import Statistics, group, statistics
from falsifier.campaigns.tables import (
    COLUMNS,
    Published,
    Score,
    Table,
    ablation_table,
    llms_table,
    main_table,
    read_published,
)
from falsifier.record.summary import Summary

# The documentation shows what is listed.
__all__ = [
    "COLUMNS",
    "Published",
    "Run",
    "Score",
    "Statistics",
    "Summary",
    "Table",
    "ablation_table",
    "columns",
    "frame",
    "group",
    "llms_table",
    "load",
    "load_run",
    "main_table",
    "not_begun",
    "read_published",
    "statistics",
]
