"""What people see of a running campaign, on stderr: a live table on a terminal, plain lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from falsifier.campaigns import Progress, RunProgress
from falsifier.core.literals import one_line
from falsifier.views.terminal import error_console, moving, unbroken

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

Show = Callable[[Progress], None]

# Simulations per second are taken over the last looks within this time in s.
_RATE_WINDOW = 10.0
# Shortest time in s between two plain lines on how far all is.
_LINE_PERIOD = 30.0


@contextmanager
def campaign_display(*, quiet: bool = False) -> Iterator[Show]:
    """Show how far a campaign is, for as long as the context lasts."""
    if quiet:
        yield lambda progress: None
        return
    console = error_console()
    if not console.is_terminal:
        board = PlainScoreboard(
            lambda text: console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)
        )
        yield unbroken(board)
        return
    from rich.live import Live

    rate = Rate()
    live = Live(console=console, refresh_per_second=4, transient=True)
    with moving(live):
        yield unbroken(lambda progress: live.update(_fitting(progress, rate(progress), console)))


class Rate:
    """Simulations per second, from the numbers of the last looks."""

    def __init__(self) -> None:
        self._seen: list[tuple[float, int]] = []

    def __call__(self, progress: Progress, now: float | None = None) -> float | None:
        """Rate at this moment in 1/s; None at the first look."""
        time = monotonic() if now is None else now
        self._seen.append((time, progress.spent.simulations))
        while self._seen[0][0] < time - _RATE_WINDOW:
            self._seen.pop(0)
        (begin, before), (end, after) = self._seen[0], self._seen[-1]
        return (after - before) / (end - begin) if end > begin else None


class PlainScoreboard:
    """One line for each run that ends, and one on the whole now and then."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._ended: dict[str, str] = {}
        self._begun = False
        self._rate = Rate()
        self._written = 0.0

    def __call__(self, progress: Progress) -> None:
        """Write what is new."""
        ended = {r.name: str(r.status) for r in progress.runs if r.status not in ("waiting", "running")}
        if not self._begun:
            self._begun, self._ended = True, ended
            self._write(f"{len(progress.runs)} runs, {progress.finished} of them finished before")
        for run in progress.runs:
            if run.name in ended and self._ended.get(run.name) != run.status:
                self._ended[run.name] = run.status
                self._write(f"[{len(self._ended)}/{len(progress.runs)}] {run_line(run)}")
        rate = self._rate(progress)
        if monotonic() - self._written > _LINE_PERIOD:
            self._written = monotonic()
            self._write(overall_line(progress, rate))


def run_line(run: RunProgress) -> str:
    """One run in a line."""
    best = "" if run.best is None else f", best robustness {run.best:+.4g}"
    count = f"{run.spent.simulations} simulation{'' if run.spent.simulations == 1 else 's'}"
    reason = f": {run.reason}" if run.status == "failed" else ""
    return f"{run.requirement} {run.method.label} seed {run.seed}: {run.status} after {count}{best}{reason}"


def overall_line(progress: Progress, rate: float | None, *, stopped: bool = False) -> str:
    """A whole campaign in a line; stopped: nobody works on it any more."""
    counts, spent = progress.counts, progress.spent
    parts = [
        f"{progress.finished}/{len(progress.runs)} runs finished",
        f"{counts['falsified']} falsified",
        *([f"{counts['failed']} failed"] if counts["failed"] else []),
        *([] if stopped else [f"{counts['running']} running"]),
        f"{spent.simulations} simulations" + ("" if rate is None else f" ({rate:.0f}/s)"),
    ]
    if spent.calls:
        cost = "cost unknown" if spent.cost is None else f"{spent.cost:.4f} US dollars"
        parts.append(f"{spent.tokens} tokens, {cost}")
    return ", ".join(parts)


def _fitting(progress: Progress, rate: float | None, console: "Console") -> "RenderableType":
    """The live table: requirements that run first, as many as the terminal has lines for."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, caption=overall_line(progress, rate), caption_justify="left")
    for name in ("requirement", "runs", "falsified", "simulations", "best robustness", "cost"):
        table.add_column(name, justify="left" if name == "requirement" else "right")
    groups = progress.by_requirement()
    order = sorted(groups, key=lambda name: -groups[name].counts["running"])
    for name in sorted(order[: max(console.height - 5, 3)], key=list(groups).index):
        part = groups[name]
        cost = part.spent.cost
        table.add_row(
            escape(one_line(name)),
            f"{part.finished}/{len(part.runs)}",
            str(part.counts["falsified"]),
            str(part.spent.simulations),
            "" if part.best is None else f"{part.best:+.4g}",
            "?" if cost is None else f"{cost:.4f}" if part.spent.calls else "",
        )
    return table
