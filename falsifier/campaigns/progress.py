"""Progress of a campaign, read from its directory: the same for the process that runs it and for others."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from falsifier.campaigns.directory import is_campaign, is_worked_on, run_directories, run_directory
from falsifier.campaigns.runs import RunProgress, requested_runs, unread_runs
from falsifier.record.summary import RunFollower, RunStatus
from falsifier.search.budget import Spent


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a campaign, or of a part of it: of all runs in the campaign's order."""

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
        return spent_together((run.name, run.spent) for run in self.runs)


class Follower:
    """Follows the directory of a campaign, of a run, or one with runs in it.

    Each look reads only what was written since the last one.

    Raises:
        JournalError: if the directory contains neither a campaign nor a run.
    """

    def __init__(self, directory: Path) -> None:
        self._places = [directory]
        if is_campaign(directory):
            asked = requested_runs(directory)
            self._runs = [RunFollower(run_directory(directory, run.name), [run]) for run in asked]
        else:
            self._places = run_directories(directory)
            self._runs = [RunFollower(p, list[RunProgress](unread_runs(p))) for p in self._places]

    @property
    def is_worked_on(self) -> bool:
        """Whether a process still works on the campaign, or on any of the runs."""
        return any(map(is_worked_on, self._places))

    def look(self) -> Progress:
        """Read what is new, and return the current progress, whose runs change with the next look."""
        return Progress(tuple(run for follower in self._runs for run in follower.look()))


def spent_together(shares: Iterable[tuple[object, Spent]]) -> Spent:
    """Return what searches have spent; of the shares that name the same search, the largest is all of it."""
    longest: dict[object, Spent] = {}
    for search, spent in shares:
        longest[search] = max(longest.get(search, spent), spent, key=lambda s: (s.simulations, s.seconds))
    return sum(longest.values(), Spent())
