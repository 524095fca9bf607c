"""The display of a running search: live on a terminal or in a notebook, plain lines otherwise."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Any

from falsifier.core.words import counted, readable
from falsifier.engines import ENGINES
from falsifier.fmu import watching
from falsifier.problem.problem import held_text
from falsifier.search import events
from falsifier.search.budget import Budget
from falsifier.search.findings import cause_of
from falsifier.search.parameterization import parameterization_note
from falsifier.stl.margins import signed
from falsifier.views.html import el, join
from falsifier.views.terminal import error_console, line_writer, live_line, unbroken

# Number of failed simulations from which on a warning is due.
_WARNED_FAILURES = 3
# Time in s without a line after which one tells how fast the search is; later, a tenth of the run's time.
_QUIET, _QUIET_SHARE = 10.0, 0.1


@contextmanager
def make_display(*, quiet: bool = False) -> Iterator[events.Listener]:
    """Make a listener that shows progress: live on a terminal or in a notebook, otherwise lines on stderr."""
    console = error_console()
    if quiet:
        yield lambda event: None
    elif console.is_terminal and not console.is_jupyter:
        with live_line(console) as update:
            line = _Line(lambda line: update(f"{line.title}: {line.text}"), line_writer(console))

            def tell(_name: str, reached: float, stop_time: float) -> None:
                update(f"{line.title}: simulated {readable(reached, 4)} of {readable(stop_time)} s")

            with watching(tell):
                yield unbroken(line)
    else:
        yield progress()


def progress() -> events.Listener:
    """Make a listener that shows the progress of a search: one live line in a notebook, else lines on stderr.

    >>> falsify("AT1", listeners=[progress()])  # doctest: +SKIP
    """
    console = error_console()
    if console.is_jupyter:  # rich's own live display would need widgets there
        return _Line(_show_in_notebook, keep=None)  # there is no place for more lines
    write, since, is_told = line_writer(console), 0.0, False

    def keep(news: str) -> None:
        nonlocal is_told
        is_told = True
        write(news)

    def show(line: _Line) -> None:
        nonlocal since, is_told
        is_due = line.seconds - since >= max(_QUIET, _QUIET_SHARE * line.seconds)
        if is_due and not is_told:
            write(line.text.strip())
        since, is_told = line.seconds if is_due or is_told else since, False

    return unbroken(_Line(show, keep))


def _show_in_notebook(line: "_Line") -> None:
    """Show a run below the cell and update it in place.

    It needs only IPython and no widgets, so every front end shows it and the last line is stored in the file.
    """
    from IPython.display import HTML, display

    bar = el("progress", value=line.done, max=line.total) if line.total else ""
    shown = HTML(join(el("code", line.title), " ", bar, f" {line.text}"))  # type: ignore[no-untyped-call]
    if line.handle is None:
        line.handle = display(shown, display_id=True)  # type: ignore[no-untyped-call]
    else:
        line.handle.update(shown)


class _Line:
    """One line on a run that is replaced as it goes on, below the news, or with the latest of them."""

    def __init__(self, show: Callable[["_Line"], None], keep: Callable[[str], None] | None) -> None:
        self._show, self._keep, self._news = show, keep, News()
        self._begin("", Budget())

    def _begin(self, title: str, budget: Budget) -> None:
        self.title = title  # the requirements and the engine
        # Maximum number of simulations, None without a limit; number so far; their time in s, 0 at the end.
        self.total, self.done, self.seconds = budget.simulations, 0, 0.0
        self.handle: Any = None  # where it is shown in a notebook
        self._most, self._note = budget.seconds or inf, ""

    @property
    def text(self) -> str:
        """How far it is, and the latest news."""
        of = f"{self.done} of " if self.total else ""
        count = counted(self.total or self.done, "simulation")
        each, more = self.seconds / max(1, self.done), (self.total or 0) - self.done
        left = min(each * more, self._most - self.seconds)
        rest = f", about {_duration(left)} left" if left >= 1 else ""
        return f"{of}{count}{rest}. {self._note}"

    def __call__(self, event: events.Event) -> None:
        """Show what an event has changed."""
        if isinstance(event, events.RunStarted):
            names = ", ".join(problem.name for problem in event.problems)
            self._begin(f"{names}, {event.engines[0]}", event.budget)
        for line in self._news.lines(event):
            if self._keep is None:
                self._note = line
            else:
                self._keep(line)
        match event:
            case events.Asked():
                return
            case events.Evaluated(spent=spent):
                self.done, self.seconds = spent.simulations, spent.seconds
            case events.Exchanged(spent=spent):
                self._note = f"LLM replied, {spent.tokens} tokens so far"
            case events.RunEnded():
                self.seconds, self._note = 0.0, f"{event.status}; {self._note}"  # no time is left
        self._show(self)


class News:
    """What is new with each event of a run, in lines; nothing is told twice."""

    def __init__(self) -> None:
        self._started: events.RunStarted | None = None
        self._told: set[str] = set()
        self._least: dict[str, float] = {}

    def lines(self, event: events.Event) -> list[str]:
        """Return all that is new: choices, improvements, causes of failures, warnings and confirmations."""
        match event:
            case events.RunStarted():
                self._started, self._told, self._least = event, set(), {}
                known = counted(event.replayed, "evaluation")
                replayed = f", {known} from the journal" if event.replayed else ""
                formulas = (f"{problem.name}: {problem.requirement.formula}" for problem in event.problems)
                sent = f", prompts go to {event.server}" if event.server else ""
                read = f", context: {', '.join(files)}" if (files := _context_files(event)) else ""
                return [*formulas, f"engine {event.engines[0]}{sent}{read}{replayed}", *_choices(event)]
            case events.Evaluated(evaluation=ended, spent=spent):
                told = []
                if ended.status != "ok" and self._is_new(f"failed: {cause_of(ended.reason)}"):
                    told.append(f"simulation {event.index + 1} {ended.outcome}")
                many = spent.failed >= _WARNED_FAILURES and spent.has_mostly_failed
                if many and self._is_new("mostly failed"):
                    told.append(
                        f"warning: {spent.failed} of {spent.simulations} simulations have failed; the run "
                        "counts as failed if more than half do"
                    )
                if better := self._better(event):
                    told.append(f"simulation {event.index + 1}: {better}")
                return told
            case events.Confirmed(confirmation=found):
                # Several requirements may share the search, so it is named.
                return [f"{found.problem.name}: violation {found.outcome}: {found.reason}"]
            case _:
                return []

    def _better(self, event: events.Evaluated) -> str:
        """Tell the smallest robustness if it has changed, of several requirements by name; else nothing."""
        told = []
        for name, seen in event.judged.items():
            verdict = seen.verdict
            if verdict is None or verdict.robustness >= self._least.get(name, inf):
                continue
            self._least[name] = verdict.robustness
            text = f"best robustness {signed(verdict.robustness)} at t = {readable(verdict.critical_time)} s"
            if self._is_new(f"{name}: {text}"):
                several = self._started is not None and len(self._started.problems) > 1
                told.append(f"{name}: {text}" if several else text)
        return "; ".join(told)

    def _is_new(self, key: str) -> bool:
        is_new = key not in self._told
        self._told.add(key)
        return is_new


def log_fmu(path: Path) -> events.Listener:
    """Make a listener that writes the FMU's messages of each simulation to a file, which it replaces."""
    is_begun = False  # by the first of the runs that follow each other

    def append(event: events.Event) -> None:
        nonlocal is_begun
        if isinstance(event, events.RunStarted) and not is_begun:
            path.write_text("", encoding="utf-8")
            is_begun = True
        if isinstance(event, events.Evaluated):
            evaluation = event.evaluation
            why = "" if evaluation.status == "ok" else f": {evaluation.reason}"
            lines = [f"simulation {event.index + 1}: {evaluation.status}{why}"]
            lines += [f"  {line}" for line in evaluation.log]
            with path.open("a", encoding="utf-8") as file:
                file.write("\n".join(lines) + "\n")

    return append


def _context_files(event: events.RunStarted) -> dict[str, None]:
    """Return the context files that are read, which a spec may name; most engines read none."""
    engine = ENGINES.get(event.engines[0])  # one that is a language model has another name
    if engine is not None and not engine.uses_context:
        return {}
    named = [problem.named_context for problem in event.problems]
    files = [name for each in named for name in each.files]
    files += ["files inside the FMU"] * any(each.fmu for each in named)
    return dict.fromkeys(files)


def _choices(event: events.RunStarted) -> list[str]:
    """Return the parameterization, and what was chosen or ignored when the problems were loaded, once."""
    chosen = dict.fromkeys(note for problem in event.problems for note in problem.notes)
    parameterization = parameterization_note(event.searched)
    held = held_text(event.problems[0].held_inputs)
    return [text for text in (parameterization, f"not searched: {held}" if held else "", *chosen) if text]


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
