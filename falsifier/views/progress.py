"""The display of a running search: live on a terminal or in a notebook, plain lines otherwise."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from typing import TYPE_CHECKING, Any

from falsifier.core.literals import one_line
from falsifier.core.words import counted
from falsifier.fmu import watching
from falsifier.problem.problem import held_text
from falsifier.search.budget import Budget, Spent
from falsifier.search.events import (
    Asked,
    Confirmed,
    Evaluated,
    Event,
    Exchanged,
    Listener,
    RunEnded,
    RunStarted,
)
from falsifier.search.findings import cause_of
from falsifier.search.levels import Level, level_name
from falsifier.search.parameterization import parameterization_note
from falsifier.stl.margins import signed
from falsifier.views.html import el, join
from falsifier.views.terminal import error_console, moving, unbroken

if TYPE_CHECKING:
    from rich.console import Console

# Number of failed simulations from which on a warning is due.
_WARNED_FAILURES = 3
# Time in s without a line after which one tells how fast the search is; later, a tenth of the run's time.
_QUIET, _QUIET_SHARE = 10.0, 0.1


@contextmanager
def make_display(*, quiet: bool = False) -> Iterator[Listener]:
    """Make a listener that shows progress: live on a terminal or in a notebook, otherwise lines on stderr."""
    if quiet:
        yield lambda event: None
        return
    console = error_console()
    if console.is_jupyter:  # rich's own live display would need widgets there
        yield NotebookLine()
        return
    if not console.is_terminal:
        yield unbroken(PlainDisplay(console))
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    progress = Progress(*columns, console=console, transient=True)
    with moving(progress):
        task = progress.add_task("starting", total=None, note="")
        warn, aims, levels, best = FailureWarning(), AimNote(), LevelNote(), BestNote()

        def show(event: Event) -> None:
            match event:
                case RunStarted():
                    total = event.budget.simulations
                    levels.begin(event)
                    best.begin(event)
                    for line in _notes(event):
                        progress.console.print(line, highlight=False, markup=False)
                    progress.update(task, description=_title(event), total=total)
                case Asked():
                    for line in (*levels(event), *aims(event)):
                        progress.console.print(one_line(line), highlight=False, markup=False)
                case Evaluated():
                    if warning := warn(event):
                        progress.console.print(warning, highlight=False, markup=False)
                    if text := best(event):
                        progress.update(task, note=text)
                    progress.update(task, completed=event.spent.simulations)
                case Exchanged():
                    progress.update(task, note=f"LLM replied, {event.spent.tokens} tokens so far")
                case Confirmed():
                    progress.console.print(one_line(_confirmed(event)), highlight=False, markup=False)
                case _:
                    pass

        def tell(_name: str, reached: float, stop_time: float) -> None:
            progress.update(task, note=f"simulated {reached:.4g} of {stop_time:g} s")

        with watching(tell):
            yield unbroken(show)


def progress() -> Listener:
    """Make a listener that shows the progress of a search: one live line in a notebook, else lines on stderr.

    >>> falsify("AT1", listeners=[progress()])  # doctest: +SKIP
    """
    console = error_console()
    return NotebookLine() if console.is_jupyter else unbroken(PlainDisplay(console))


class PlainDisplay:
    """Prints a line at the start, per improvement, cause of failures and confirmation, or after a while."""

    def __init__(self, console: "Console") -> None:
        self._console = console
        self._warn = FailureWarning()
        self._aims, self._levels, self._best = AimNote(), LevelNote(), BestNote()
        self._pace = PaceNote()
        self._causes: set[str] = set()

    def __call__(self, event: Event) -> None:
        """Print a line if the event deserves one."""
        match event:
            case RunStarted():
                known = counted(event.replayed, "evaluation")
                replayed = f", {known} from the journal" if event.replayed else ""
                for problem in event.problems:
                    self._line(f"{problem.name}: {problem.requirement.formula}")
                self._line(f"engine {event.engines[0]}{replayed}")
                self._levels.begin(event)
                self._best.begin(event)
                self._pace.begin(event)
                for line in _notes(event):
                    self._line(line)
            case Asked():
                for line in (*self._levels(event), *self._aims(event)):
                    self._line(line)
            case Evaluated():
                lines = list(self._told(event))
                pace = self._pace(event.spent, told=bool(lines))
                for line in (*lines, *([pace] if pace else [])):
                    self._line(line)
            case Confirmed():
                self._line(_confirmed(event))
            case _:
                pass

    def _told(self, event: Evaluated) -> Iterator[str]:
        """What is new with a simulation; a cause of failures is told once."""
        evaluation = event.evaluation
        if evaluation.status != "ok" and (cause := cause_of(evaluation.reason)) not in self._causes:
            self._causes.add(cause)
            how = "timed out" if evaluation.status == "timeout" else evaluation.status
            yield f"simulation {event.index + 1} {how}: {evaluation.reason}"
        if warning := self._warn(event):
            yield warning
        if best := self._best(event):
            yield f"simulation {event.index + 1}: {best}"

    def _line(self, text: str) -> None:
        self._console.print(one_line(text), highlight=False, markup=False, soft_wrap=True)


class FailureWarning:
    """Tells once that more than half of the simulations have failed, if these are more than a few."""

    def __init__(self) -> None:
        self._told = False

    def __call__(self, event: Evaluated) -> str | None:
        """Return the warning, or None if there is nothing to tell."""
        spent = event.spent
        if self._told or spent.failures < _WARNED_FAILURES or not spent.has_mostly_failed:
            return None
        self._told = True
        return (
            f"warning: {spent.failures} of {spent.simulations} simulations have failed; the run counts as "
            "failed if more than half do"
        )


class BestNote:
    """Tells the smallest robustness when it has changed; of several requirements by name."""

    def __init__(self) -> None:
        self._least: dict[str, float] = {}
        self._said: dict[str, str] = {}
        self._several = False

    def begin(self, event: RunStarted) -> None:
        """Learn whether several requirements share the search."""
        self._several = len(event.problems) > 1

    def __call__(self, event: Evaluated) -> str:
        """Return what is new in a few words; empty if nothing is."""
        told = []
        for name, seen in event.judged.items():
            verdict = seen.verdict
            if verdict is None or verdict.robustness >= self._least.get(name, inf):
                continue
            self._least[name] = verdict.robustness
            text = f"best robustness {signed(verdict.robustness, 5)} at t = {verdict.critical_time:.5g} s"
            if self._said.get(name) != text:
                self._said[name] = text
                told.append(f"{name}: {text}" if self._several else text)
        return "; ".join(told)


class PaceNote:
    """Tells how fast a search is and what is left of it, if nothing else was told for a while."""

    def __init__(self) -> None:
        self._budget = Budget()
        self._since = Spent()

    def begin(self, event: RunStarted) -> None:
        """Learn the limits of a run that starts."""
        self._budget, self._since = event.budget, Spent()

    def __call__(self, spent: Spent, *, told: bool) -> str:
        """Return a line if it is time for one.

        Args:
            spent: what the run has spent so far.
            told: whether another line is printed now.
        """
        quiet = spent.seconds - self._since.seconds
        if told or quiet < max(_QUIET, _QUIET_SHARE * spent.seconds):
            self._since = spent if told else self._since
            return ""
        rate = (spent.simulations - self._since.simulations) / quiet
        self._since = spent
        most = self._budget.simulations
        left = [] if most is None else [(most - spent.simulations) / rate]
        left += [] if self._budget.seconds is None else [self._budget.seconds - spent.seconds]
        of = "" if most is None else f" of {most}"
        pace = f"{rate:.3g} per s" if rate >= 1 else f"{1 / rate:.3g} s each"
        rest = f", at most {_duration(max(0.0, min(left)))} left" if left else ""
        return f"simulation {spent.simulations}{of}: nothing better; {pace}{rest}"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


class LevelNote:
    """Tells what each level of a search that refines its inputs searches, when it begins."""

    def __init__(self) -> None:
        self._levels: list[tuple[int, Level]] = []
        self._count = 0

    def begin(self, event: RunStarted) -> None:
        """Learn the levels of a run that starts."""
        self._levels = list(enumerate(event.levels, start=1))
        self._count = len(event.levels)

    def __call__(self, event: Asked) -> list[str]:
        """Return the lines to print; none if there is nothing to tell."""
        begun = [pair for pair in self._levels if pair[1].first <= event.first]
        self._levels = self._levels[len(begun) :]
        return [
            f"{level_name(number, self._count)}, from simulation {level.first + 1} on: "
            f"{parameterization_note(level.space)}"
            for number, level in begun
        ]


class AimNote:
    """Tells once of each condition that never held that the search now aims at it."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def __call__(self, event: Asked) -> list[str]:
        """Return the lines to print; none if there is nothing to tell."""
        new = {c.aim: c for c in event.candidates if c.aim and c.aim not in self._told}
        self._told |= new.keys()
        return [f"{event.problem.name}: {c.rationale.partition(': ')[0]}" for c in new.values()]


def note(event: Evaluated) -> str:
    """Best robustness so far, in a few words."""
    best = event.best
    if best is None or best.verdict is None:
        return "no successful simulation yet"
    return f"best robustness {signed(best.verdict.robustness, 5)} at t = {best.verdict.critical_time:.5g} s"


class NotebookLine:
    """Shows a run as one line below the cell and updates it in place.

    It needs only IPython and no widgets, so every front end shows it and the last line is stored in the file.
    """

    def __init__(self) -> None:
        self._handle: Any = None
        self._name = self._note = ""
        self._total: int | None = None

    def __call__(self, event: Event) -> None:
        """Update the line."""
        match event:
            case RunStarted():
                self._name = _title(event)
                self._handle, self._total = None, event.budget.simulations
                self._show(0)
            case Evaluated():
                self._note = note(event)
                self._show(event.spent.simulations)
            case Exchanged():
                self._note = f"LLM replied, {event.spent.tokens} tokens so far"
                self._show(event.spent.simulations)
            case Confirmed():
                self._note = f"violation {event.confirmation.outcome}"
            case RunEnded():
                self._note = f"{event.status}; {self._note}"
                self._show(event.spent.simulations)

    def _show(self, done: int) -> None:
        from IPython.display import HTML, display

        bar = el("progress", value=done, max=self._total) if self._total else ""
        count = (
            f"{done} of {counted(self._total, 'simulation')}" if self._total else counted(done, "simulation")
        )
        text = join(el("code", self._name), " ", bar, f" {count}. ", self._note)
        line = HTML(text)  # type: ignore[no-untyped-call]
        if self._handle is None:
            self._handle = display(line, display_id=True)  # type: ignore[no-untyped-call]
        else:
            self._handle.update(line)


def _notes(event: RunStarted) -> list[str]:
    """Return the parameterization, and what was chosen or ignored when the problems were loaded, once."""
    chosen = dict.fromkeys(note for problem in event.problems for note in problem.notes)
    parameterization = parameterization_note(event.searched)
    if event.levels:
        parameterization = f"inputs are refined in {len(event.levels)} levels, from coarse to fine"
    held = held_text(event.problems[0].held_inputs)
    unsearched = f"not searched: {held}" if held else ""
    return [text for text in (parameterization, unsearched, *chosen) if text]


def _confirmed(event: Confirmed) -> str:
    """What came of a violation; several requirements may share the search, so it is named."""
    found = event.confirmation
    return f"{found.problem.name}: violation {found.outcome}: {found.reason}"


def _title(event: RunStarted) -> str:
    """The requirements and the engine."""
    return one_line(f"{', '.join(problem.name for problem in event.problems)}, {event.engines[0]}")
