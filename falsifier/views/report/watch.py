"""A page that follows a run or campaign while it goes on, or shows it after its end; from the journals alone.

::

    asyncio.run(serve(Path("runs/nightly"), announce=print))

The page is served on this machine only, and runs no script: the browser loads it again and again. Each answer
reads on in the journals for a moment only, so that the page of a long run opens at once and completes itself.
"""

import asyncio
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from secrets import compare_digest, token_urlsafe
from time import monotonic
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from falsifier.analyses.coverage import coverage_of
from falsifier.campaigns.analysis import Run
from falsifier.campaigns.directory import is_campaign, is_worked_on, run_directories
from falsifier.campaigns.progress import Follower
from falsifier.campaigns.runs import RunProgress, unread_runs
from falsifier.core.candidate import Candidate
from falsifier.core.files import write_whole
from falsifier.core.words import counted
from falsifier.errors import FalsifierError
from falsifier.llm.messages import Exchange
from falsifier.record.journal import STOP
from falsifier.record.records import AskedRecord, ExchangeRecord
from falsifier.record.summary import RunFollower
from falsifier.views.campaign_progress import overall_line
from falsifier.views.exchanges import exchange_html
from falsifier.views.html import Html, el, join
from falsifier.views.plotting import plot_coverage, plot_history
from falsifier.views.report.content import section_of, shown_of
from falsifier.views.report.page import card_html, document, drawn, facts_html
from falsifier.views.text import llm_use, seconds_text

if TYPE_CHECKING:
    from aiohttp.web import Application, Request, Response, StreamResponse

# Time in s that the first answer may spend on reading, and each later one: a journal of 100,000 evaluations
# takes some ten, and the figures of an answer one.
_READING, _READING_ON = 0.3, 2.0
# Time in s after which the browser loads the page of a running search again, and one that is not read yet.
_PERIOD, _PERIOD_BEHIND = 5, 1
# Maximum number of candidates kept of a run, evenly spaced, to show what was tried.
_MOST_KEPT = 300
# Maximum number of runs of a campaign to choose from.
_MOST_RUNS = 200


@dataclass(slots=True)
class _Watched:
    """One run directory, and what was read of it so far."""

    run: RunFollower[Run]
    candidates: dict[int, Candidate] = field(default_factory=dict)
    exchange: Exchange | None = None
    _every: int = 1

    def read(self, until: float) -> bool:
        """Read on until the clock (in s) says that it is enough; return whether there may be more."""
        for record in self.run.read():
            if isinstance(record, AskedRecord):
                self.candidates |= dict(enumerate(record.candidates, start=record.first))
                self._thin()
            elif isinstance(record, ExchangeRecord):
                self.exchange = record.exchange
            if monotonic() > until:
                return True
        return False

    def _thin(self) -> None:
        """Keep the candidates that are still to be simulated or to be shown, and of the others every n-th."""
        if len(self.candidates) <= 2 * _MOST_KEPT:
            return
        self._every *= 2
        needed = {run.shown for run in self.run.summaries}
        needed |= set(range(max(self.candidates) - _MOST_KEPT // 2, max(self.candidates) + 1))
        kept = [index for index in self.candidates if index % self._every == 0 or index in needed]
        self.candidates = {index: self.candidates[index] for index in kept}


class Watch:
    """What the page of a directory shows; each look reads on.

    Args:
        directory: a run, a campaign, or a folder of runs.
        token: what a stop must name; empty: the page has no button for it.

    Raises:
        JournalError: if the directory is none of these, or a file in it is invalid.
    """

    def __init__(self, directory: Path, token: str = "") -> None:
        self.directory = directory
        self.token = token
        self._watched: _Watched | None = None  # one run at a time is in memory
        run_directories(directory)  # raises if there is nothing to watch
        self._follower = Follower(directory) if is_campaign(directory) else None

    def look(self, chosen: str = "") -> tuple[str, int | None]:
        """Return the content of the page, and the time in s after which there is more; None if nothing comes.

        Without the name of the folder of a run, the first that is running is shown.
        """
        found = run_directories(self.directory)
        is_one = self._follower is not None or found == [self.directory]
        places = {str(p.relative_to(p.parent if is_one else self.directory)): p for p in found}
        parts, rows = [], list[RunProgress]()
        working = is_worked_on(self.directory)
        if self._follower is not None:
            progress = self._follower.look()
            rows = list(progress.runs)
            parts.append(el("p", overall_line(progress, stopped=not working), class_="result"))
        if chosen not in places:
            running = [run.name for run in rows if run.status == "running" and run.name in places]
            chosen = next(iter([*running, *places]), "")
        if len(places) > 1 or rows:
            parts.append(_choice(places.keys(), rows))
        behind = False
        if chosen:
            seconds = _READING_ON
            if self._watched is None or self._watched.run.directory != places[chosen]:
                seconds = _READING
                self._watched = _Watched(RunFollower(places[chosen], unread_runs(places[chosen])))
            watched = self._watched
            behind = watched.read(monotonic() + seconds)
            working = working or is_worked_on(places[chosen])
            state = "reading the journal" if behind else "running" if working else "not running"
            parts.append(el("p", f"{chosen}: {state}.", class_="result"))
            if working:
                still = el("a", "keep it as it is", href=f"?run={quote(chosen)}&still")
                parts.append(el("p", "This page reloads itself; to read on, ", still, "."))
            if working and self.token:
                token = el("input", type="hidden", name="token", value=self.token)
                parts.append(el("form", token, el("button", "Stop"), method="post", action="stop"))
            parts += [_run_html(run, watched) for run in watched.run.summaries]
        return join(*parts), _PERIOD_BEHIND if behind else _PERIOD if working else None

    def stop(self) -> None:
        """Ask the process that works here to stop as after Ctrl-C: it looks for this file."""
        write_whole(self.directory / STOP, "stopped on the watch page\n")  # which follows no link


def _choice(places: Collection[str], rows: Sequence[RunProgress]) -> Html:
    """The runs to choose from, those of a campaign with what came of them so far, running ones first."""
    order = sorted(rows, key=lambda run: (run.status != "running", run.finished))[:_MOST_RUNS]
    told = {run.name: str(run) for run in order} or {name: name for name in places}
    runs = [
        el("a", text, href=f"?run={quote(name)}") if name in places else text for name, text in told.items()
    ]
    return el(
        "details",
        el("summary", f"{len(told)} of {counted(len(rows or places), 'run')}"),
        el("ul", *(el("li", run) for run in runs)),
        open="",
    )


def _run_html(run: Run, watched: _Watched) -> Html:
    """One requirement of a run: the card of the report, then how the search goes."""
    best = None if run.shown is None else watched.candidates.get(run.shown)
    shown = [] if best is None else [shown_of(run, best)]
    count = len(run.robustness)
    tried = [(c, None) for i, c in sorted(watched.candidates.items()) if i < count]
    history = drawn(partial(plot_history, run), "Robustness over simulations")
    covered = drawn(lambda: plot_coverage(coverage_of(run.manifest, tried)), "What was tried")
    facts = [("time", seconds_text(run.spent))]
    facts += [("language model", llm_use(run.spent))] if run.spent.questions else []
    of = "" if len(tried) == count else f" ({len(tried)} of {count} simulations)"
    more = [el("h3", "Robustness over simulations"), history]
    more += [el("h3", f"What was tried{of}"), covered] if tried else []
    more += [el("h3", "What it costs"), facts_html(facts)]
    if watched.exchange:
        title = "The last question to the language model, and its answer"
        more += [el("h3", title), exchange_html(watched.exchange)]
    return card_html(section_of(run.requirement, [run], shown, [run]), more=more)


def application(watch: Watch) -> "Application":
    """Return the pages as an application of aiohttp."""
    from aiohttp import web

    name = watch.directory.resolve().name
    lock = asyncio.Lock()

    @web.middleware
    async def from_here(request: "Request", handler: Callable[["Request"], Any]) -> "StreamResponse":
        # Another page in the same browser may reach this port under a name of its own.
        if request.host.partition(":")[0] not in ("127.0.0.1", "localhost"):
            raise web.HTTPForbidden(text="this page is served to 127.0.0.1 only")
        answer: StreamResponse = await handler(request)
        return answer

    async def page(request: "Request") -> "Response":
        async with lock:  # figures are drawn one at a time, beside the loop that answers
            try:
                text, again = await asyncio.to_thread(watch.look, request.query.get("run", ""))
            except FalsifierError as error:  # what is on disk may be damaged, or taken away meanwhile
                text, again = el("p", str(error), class_="result"), None
        headers = {"Cache-Control": "no-store"}
        if again is not None and "still" not in request.query:
            headers["Refresh"] = str(again)
        shown = document(f"falsifier: {name}", el("header", el("h1", name)), el("main", Html(text)))
        return web.Response(text=shown, content_type="text/html", headers=headers)

    async def stop(request: "Request") -> "Response":
        token = str((await request.post()).get("token", ""))
        if not watch.token:
            raise web.HTTPForbidden(text="stopping was not allowed: falsifier watch --page --allow-stop")
        if not compare_digest(token.encode(), watch.token.encode()):
            raise web.HTTPForbidden(text="this page is older than its server: load it again, then stop")
        watch.stop()
        raise web.HTTPSeeOther("/")

    made = web.Application(middlewares=[from_here])
    made.router.add_get("/", page)
    made.router.add_post("/stop", stop)
    return made


async def serve(directory: Path, *, announce: Callable[[str], None], allow_stop: bool = False) -> None:
    """Serve the page of a directory on 127.0.0.1 until this is cancelled.

    The address, which has a free port, is announced. With allow_stop, the page has a button.

    Raises:
        JournalError: if the directory is no run, campaign or folder of runs, or a file in it is invalid.
    """
    from aiohttp import web

    runner = web.AppRunner(
        application(Watch(directory, token_urlsafe() if allow_stop else "")), access_log=None
    )
    await runner.setup()
    try:
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        announce(f"http://127.0.0.1:{runner.addresses[0][1]}/")
        await asyncio.Event().wait()
    finally:
        await runner.cleanup()
