"""The display of a running campaign on stderr: a line per run that ends, and how the whole goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from falsifier.campaigns import Progress
from falsifier.core.words import counted
from falsifier.search.budget import Spent
from falsifier.views.terminal import error_console, line_writer, live_line, unbroken

Show = Callable[[Progress], None]
Write = Callable[[str], None]

# Minimum time in s between two plain lines with the overall progress.
_LINE_PERIOD = 30.0


@contextmanager
def campaign_display(*, quiet: bool = False) -> Iterator[Show]:
    """Show a campaign's progress while the context lasts."""
    console = error_console()
    write = line_writer(console)
    if quiet:
        yield lambda progress: None
    elif not console.is_terminal:
        yield unbroken(Scoreboard(write))
    else:
        with live_line(console) as update:
            yield unbroken(Scoreboard(write, update))


class Scoreboard:
    """Tells of each run that ends, and of all of them: in a line that is replaced, or now and then."""

    def __init__(self, write: Write, update: Write | None = None) -> None:
        self._write, self._update = write, update
        # What runs had spent when they ended, and why; which have ended for good or since the start.
        self._ended: dict[str, tuple[Spent, str]] | None = None
        self._done: set[str] = set()
        self._written, self._overall = 0.0, ""

    def __call__(self, progress: Progress) -> None:
        """Write a line per run that ended since the last call."""
        ended = {r.name: (r.spent, r.reason) for r in progress.runs if r.status not in ("waiting", "running")}
        if self._ended is None:  # runs that ended before this start get no line, but those that are repeated
            self._ended, self._done = ended, {r.name for r in progress.runs if r.finished}
            self._write(f"{counted(len(progress.runs), 'run')}, {progress.finished} already finished")
        for run in progress.runs:
            if run.name in ended and self._ended.get(run.name) != ended[run.name]:
                self._ended[run.name] = ended[run.name]
                self._done.add(run.name)
                self._write(f"[{len(self._done)}/{len(progress.runs)}] {run}")
        line = overall_line(progress)
        if self._update is not None:
            self._update(line)
        elif monotonic() - self._written > _LINE_PERIOD and line != self._overall:
            self._written, self._overall = monotonic(), line
            self._write(line)


def overall_line(progress: Progress, *, stopped: bool = False) -> str:
    """Describe a campaign's progress in one line; stopped: no process works on it any more."""
    counts, spent = progress.counts, progress.spent
    parts = [
        f"{progress.finished}/{counted(len(progress.runs), 'run')} finished",
        f"{counts['falsified']} falsified",
        *([f"{counts['failed']} failed"] if counts["failed"] else []),
        *([] if stopped else [f"{counts['running']} running"]),
        spent.simulations_text,
    ]
    if spent.questions:
        parts.append(f"{spent.tokens} tokens, {spent.cost_text}")
    return ", ".join(parts)
