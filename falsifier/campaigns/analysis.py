"""The results of runs and campaigns in numbers, read from their directories.

::

    from falsifier.campaigns.analysis import frame, load

    runs = load(Path("runs/nightly"))
    frame(runs).groupby(["requirement", "method"]).simulations.mean()
"""

from falsifier.campaigns.runs import (
    Run as Run,
    columns as columns,
    frame as frame,
    load as load,
    load_run as load_run,
)
from falsifier.campaigns.statistics import Statistics as Statistics, group as group, statistics as statistics
from falsifier.campaigns.tables import (
    COLUMNS as COLUMNS,
    Published as Published,
    Score as Score,
    Table as Table,
    ablation_table as ablation_table,
    llms_table as llms_table,
    main_table as main_table,
    read_published as read_published,
)
from falsifier.record.summary import Summary as Summary
