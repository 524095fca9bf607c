"""Progress of a campaign, read from its directory: the same for the process that runs it and for others."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

from falsifier.campaigns.directory import (
    is_campaign,
    is_worked_on,
    read_campaign,
    run_directories,
    run_directory,
)
from falsifier.campaigns.request import Method, method_of, method_of_run
from falsifier.record import manifest
from falsifier.record.journal import JournalReader
from falsifier.record.summary import FINISHED, RunStatus, Summary
from falsifier.search.budget import Spent
from falsifier.search.request import RunRequest


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProgress:
    """Progress of one run.

    Attributes:
        name: name of its directory.
        requirement: name of the requirement.
        method: how it searches.
        seed: seed of its engine.
        status: ``waiting``, ``running`` or how it ended.
        reason: why it ended.
        best: smallest robustness so far, or None.
        spent: what it has spent so far.
    """

    name: str
    requirement: str
    method: Method
    seed: int
    status: RunStatus
    reason: str
    best: float | None
    spent: Spent

    @property
    def finished(self) -> bool:
        """Whether nothing is left to do; failed and interrupted runs are continued when resuming."""
        return self.status in FINISHED


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a campaign, or of a part of it.

    Attributes:
        runs: all runs in the campaign's order.
    """

    runs: tuple[RunProgress, ...]

    @property
    def counts(self) -> Mapping[RunStatus, int]:
        """Number of runs by status."""
        return Counter(run.status for run in self.runs)

    @property
    def finished(self) -> int:
        """Number of finished runs."""
        return sum(run.finished for run in self.runs)

    @property
    def spent(self) -> Spent:
        """What all runs together have spent; the cost is None if that of any run is unknown."""
        searches: dict[str, Spent] = {}  # requirements that share a search also share what it has spent
        for run in self.runs:
            known = searches.setdefault(run.name, run.spent)
            searches[run.name] = max(known, run.spent, key=lambda spent: spent.simulations)
        return total(searches.values())

    def by_requirement(self) -> dict[str, "Progress"]:
        """Progress of each requirement."""
        groups: dict[str, list[RunProgress]] = {}
        for run in self.runs:
            groups.setdefault(run.requirement, []).append(run)
        return {name: Progress(tuple(runs)) for name, runs in groups.items()}

    @property
    def best(self) -> float | None:
        """Smallest robustness of any run."""
        return min((run.best for run in self.runs if run.best is not None), default=None)


@dataclass(slots=True)
class _Followed:
    """One requirement in a run's journal, and the numbers read from it so far; None: the run has only one."""

    name: str
    request: RunRequest
    directory: Path
    method: Method
    requirement: str | None = None
    summary: Summary = field(init=False)
    reader: JournalReader = field(init=False)

    def __post_init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.summary = Summary(self.requirement)
        self.reader = JournalReader(self.directory, with_candidates=False)

    def read(self) -> None:
        if self.reader.shrank:  # an incomplete line was dropped, or the directory was replaced
            self.begin()
        for record in self.reader.new():
            self.summary.add(record)
        if self.reader.begun:
            self.summary.begin()

    def progress(self) -> RunProgress:
        summary = self.summary
        return RunProgress(
            name=self.name,
            requirement=self.requirement or self.request.problems[0].name,
            method=self.method,
            seed=self.request.seed,
            status=summary.status,
            reason=summary.reason,
            best=summary.best_robustness,
            spent=summary.spent,
        )


class Follower:
    """Follows the directory of a campaign, of a run, or one with runs in it.

    Each look reads only what was written since the last one.

    Raises:
        JournalError: if the directory contains neither a campaign nor a run.
    """

    def __init__(self, directory: Path) -> None:
        if is_campaign(directory):
            runs = read_campaign(directory).runs
            self._places = [directory]
            self._runs = [_Followed(n, r, run_directory(directory, n), method_of(r)) for n, r in runs.items()]
            return
        self._places = run_directories(directory)
        self._runs = []
        for place in self._places:
            described = manifest.read(place)
            method = method_of_run(described)
            self._runs += [
                _Followed(str(place), described.request, place, method, n) for n in described.names
            ]

    @property
    def is_worked_on(self) -> bool:
        """Whether a process still works on the campaign, or on any of the runs."""
        return any(map(is_worked_on, self._places))

    def look(self) -> Progress:
        """Read what is new, and return the current progress."""
        for run in self._runs:
            run.read()
        return Progress(tuple(run.progress() for run in self._runs))


def total(spent: Iterable[Spent]) -> Spent:
    """Sum of what several runs have spent; unknown if that of any run is."""
    listed = list(spent)

    def added(name: str) -> float | None:
        numbers = [getattr(each, name) for each in listed]
        return None if None in numbers else sum(numbers)

    return Spent(**{f.name: added(f.name) for f in fields(Spent)})  # type: ignore[arg-type]
