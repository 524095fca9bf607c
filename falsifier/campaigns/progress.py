"""How far a campaign is, read from its directory: the same for who runs it and for who watches it."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import reduce
from pathlib import Path

from falsifier.campaigns.directory import read_campaign, run_directory
from falsifier.campaigns.plan import Method, method_of
from falsifier.search.budget import Spent
from falsifier.search.journal import JournalReader
from falsifier.search.request import RunRequest
from falsifier.search.tally import FINISHED, RunStatus, Tally


@dataclass(frozen=True, slots=True, kw_only=True)
class RunProgress:
    """How far one run is.

    Attributes:
        name: of its directory.
        requirement: as asked for.
        method: how it searches.
        seed: of its engine.
        status: ``waiting``, ``running`` or how it ended.
        reason: why it ended.
        best: smallest robustness so far, or None.
        spent: what it has used so far.
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
        """Whether nothing is left to do for it; failed and interrupted runs are not finished."""
        return self.status in FINISHED


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a campaign is.

    Attributes:
        runs: every run in the campaign's order.
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
        """What all runs together have used; the cost is None where any is unknown."""
        return total(run.spent for run in self.runs)

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
    """A run's journal and how much of it was read."""

    name: str
    request: RunRequest
    directory: Path
    tally: Tally = field(init=False)
    reader: JournalReader = field(init=False)

    def __post_init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.tally, self.reader = Tally(), JournalReader(self.directory, with_candidates=False)

    def read(self) -> None:
        if self.reader.shrank:  # a torn line was dropped, or the directory was replaced
            self.begin()
        for record in self.reader.new():
            self.tally.add(record)
        if self.reader.begun:
            self.tally.begin()

    def progress(self) -> RunProgress:
        tally = self.tally
        return RunProgress(
            name=self.name,
            requirement=self.request.problems[0].name,
            method=method_of(self.request),
            seed=self.request.seed,
            status=tally.status,
            reason=tally.reason,
            best=tally.best_robustness,
            spent=tally.spent,
        )


class Follower:
    """Reads what was written to a campaign's directory since the last look.

    Raises:
        JournalError: when the directory is not a campaign's.
    """

    def __init__(self, directory: Path) -> None:
        runs = read_campaign(directory).runs
        self._runs = [_Followed(n, r, run_directory(directory, n)) for n, r in runs.items()]

    def look(self) -> Progress:
        """How far the campaign is now."""
        for run in self._runs:
            run.read()
        return Progress(tuple(run.progress() for run in self._runs))


def total(spent: Iterable[Spent]) -> Spent:
    """Sum of what several runs have used."""
    return reduce(_plus, spent, Spent())


def _plus(a: Spent, b: Spent) -> Spent:
    def added(name: str) -> float | None:
        one, other = getattr(a, name), getattr(b, name)
        return None if one is None or other is None else one + other

    return Spent(**{f.name: added(f.name) for f in fields(Spent)})  # type: ignore[arg-type]
