"""The page that follows runs: its content, its server, and the stop that it may ask for."""

import asyncio
import re
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from queue import Queue
from threading import Thread

import pytest

from falsifier.campaigns import Progress, run_campaign
from falsifier.errors import JournalError
from falsifier.llm.scripted import ScriptedChat
from falsifier.record.journal import JOURNAL
from falsifier.record.run import falsify, resume
from falsifier.search.events import Evaluated, Event
from falsifier.testing import lag_problem
from falsifier.views.html import Html
from falsifier.views.report import markdown_report, watch as module
from falsifier.views.report.watch import Watch, serve
from tests.campaigns.support import request, work_in_threads
from tests.patience import HANG
from tests.problems import hard, impossible
from tests.views.chromium import chromium, needs_chromium


@contextmanager
def served(directory: Path, *, allow_stop: bool = False) -> Iterator[int]:
    """Serve the page in a thread; yield its port."""
    told: Queue[str] = Queue()
    loop = asyncio.new_event_loop()
    task = loop.create_task(serve(directory, announce=told.put, allow_stop=allow_stop))

    def work() -> None:
        with pytest.raises(asyncio.CancelledError):
            loop.run_until_complete(task)
        loop.close()

    thread = Thread(target=work)
    thread.start()
    try:
        yield int(told.get(timeout=HANG).rstrip("/").rpartition(":")[2])
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join()


def asked(port: int, path: str, method: str = "GET", form: str = "", **headers: str) -> HTTPResponse:
    connection = HTTPConnection("127.0.0.1", port, timeout=HANG)
    kind = {"Content-Type": "application/x-www-form-urlencoded"} if form else {}
    connection.request(method, path, form or None, {**kind, **headers})
    return connection.getresponse()


def test_a_run_is_shown_as_in_its_report_with_how_the_search_goes(tmp_path: Path) -> None:
    falsify(hard(), "uniform", budget=20, directory=tmp_path / "run")
    text, again = Watch(tmp_path / "run").look()
    assert again is None
    assert 'class="card violated"' in text and "was violated" in text
    for title in ("Robustness over simulations", "What was tried", "What it costs"):
        assert f"<h3>{title}</h3>" in text
    assert text.count("data:image/svg+xml") == 3
    assert "not running" in text and "<button" not in text


def test_what_a_model_was_asked_last_is_shown(tmp_path: Path) -> None:
    falsify(impossible(), llm=ScriptedChat(lambda _: "no idea <b>"), budget=2, directory=tmp_path / "run")
    text, _ = Watch(tmp_path / "run").look()
    assert "The last question to the language model" in text and "no idea &lt;b&gt;" in text
    assert "To see the questions to the language model: `falsifier" in markdown_report(tmp_path / "run")
    with pytest.raises(JournalError, match="not a run or campaign"):
        Watch(tmp_path / "run" / "trajectories")


def test_a_long_journal_is_read_piece_by_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for limit in ("_READING", "_READING_ON"):
        monkeypatch.setattr(module, limit, 0.0)
    monkeypatch.setattr(module, "_MOST_KEPT", 4)
    for where in ("watch", "page"):  # drawing takes most of the time
        monkeypatch.setattr(f"falsifier.views.report.{where}.drawn", lambda make, description: Html(""))
    falsify(impossible(), "uniform", budget=12, directory=tmp_path / "run")
    watch = Watch(tmp_path / "run")
    first, again = watch.look()
    assert again and "reading the journal" in first
    looks = 1
    while again:
        text, again = watch.look()
        looks += 1
    assert looks > 12
    assert "no violation found in 12 simulations" in text
    assert re.search(r"What was tried \(\d of 12 simulations\)", text)
    assert "The simulation nearest to a violation" in text, "its candidate was kept"


def test_what_is_written_later_is_seen(tmp_path: Path) -> None:
    seen = list[str]()

    def look(event: Event) -> None:
        if isinstance(event, Evaluated) and event.index in (2, 5):
            text, again = watch.look()
            assert again, "more will come"
            seen.append(text)

    falsify(impossible(), "uniform", budget=1, directory=tmp_path / "run")
    watch = Watch(tmp_path / "run")
    resume(tmp_path / "run", budget=8, problems=[impossible()], listeners=[look])
    assert ["3 simulations so far" in seen[0], "6 simulations so far" in seen[1]] == [True, True]
    assert "running" in seen[0]


def test_of_a_campaign_each_run_can_be_chosen(campaign: Path) -> None:
    watch = Watch(campaign)
    text, _ = watch.look()
    assert "8/8 runs finished, 4 falsified" in text and "8 of 8 runs" in text
    names = re.findall(r'href="\?run=([^"]*)"', text)
    assert len(names) == 8
    chosen = [watch.look(name)[0] for name in (names[-1], "../../etc", names[0])]
    assert f"{names[-1]}: not running" in chosen[0]
    assert "../../etc" not in chosen[1]
    assert f"{names[0]}: not running" in chosen[2]


def test_the_link_to_a_run_has_its_name_also_with_special_characters(tmp_path: Path) -> None:
    for name in ("a", "b&c #1+"):
        falsify(hard(), "uniform", budget=1, directory=tmp_path / name)
    assert 'href="?run=b%26c%20%231%2B"' in Watch(tmp_path).look()[0]


def test_the_page_is_served_to_this_machine_and_loaded_again_only_while_more_comes(tmp_path: Path) -> None:
    falsify(hard(), "uniform", budget=20, directory=tmp_path / "run")
    with served(tmp_path / "run") as port:
        first = asked(port, "/")
        text = first.read().decode()
        assert (first.status, 'class="card violated"' in text, "<script" in text) == (200, True, False)
        assert first.headers["Refresh"] is None
        assert asked(port, "/", Host="evil.example").status == 403
        assert asked(port, "/stop", "POST").status == 403


def test_the_page_of_a_damaged_run_says_what_to_do(tmp_path: Path) -> None:
    falsify(hard(), "uniform", budget=1, directory=tmp_path)
    with (tmp_path / JOURNAL).open("a") as journal:
        journal.write("<b>no record</b>\n")
    with served(tmp_path) as port:
        answer = asked(port, "/")
        assert (answer.status, "falsifier tools repair" in answer.read().decode()) == (200, True)


def test_a_stop_needs_the_pages_token_and_ends_a_run_that_can_be_resumed(tmp_path: Path) -> None:
    watch, steps = Watch, []

    def press(event: Event) -> None:
        if isinstance(event, Evaluated):
            steps.append(event.index)
            if event.index == 1:
                with served(tmp_path / "run", allow_stop=True) as port:
                    page, still = asked(port, "/"), asked(port, "/?still")
                    assert page.headers["Refresh"] == "5" and still.headers["Refresh"] is None
                    token = re.search(r'name="token" value="([^"]*)"', page.read().decode())
                    assert token is not None
                    assert asked(port, "/stop", "POST", "token=wrong").status == 403
                    assert asked(port, "/stop", "POST", f"token={token[1]}").status == 303

    problem = lag_problem("G[0,10] (x <= 2)", name="LONG")
    result = falsify(problem, "uniform", budget=100_000, directory=tmp_path / "run", listeners=[press])
    assert (result.status, result.reason) == ("interrupted", "stopped on the watch page")
    assert "<button" not in watch(tmp_path / "run", token="t").look()[0], "nothing is left to stop"
    (again,) = resume(tmp_path / "run", problems=[problem], budget=len(steps) + 1)
    assert again.status == "not falsified"


def test_a_stop_of_a_campaign_ends_all_its_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    work_in_threads(monkeypatch)

    def press(progress: Progress) -> None:
        if progress.spent.simulations and not progress.finished:
            Watch(tmp_path / "c", token="t").stop()

    ended = run_campaign(request("impossible", budget=100_000), tmp_path / "c", listeners=[press])
    assert ended.reason == "stopped on the watch page"
    assert not ended.progress.finished and not (tmp_path / "c" / "stop").exists()


@needs_chromium
def test_a_browser_shows_it(tmp_path: Path) -> None:
    falsify(hard(), "uniform", budget=20, directory=tmp_path / "run")
    with served(tmp_path / "run") as port:
        address = f"http://127.0.0.1:{port}/"
        dom = chromium("--dump-dom", "--virtual-time-budget=3000", address, profile=tmp_path / "profile")
    assert 'class="card violated"' in dom and dom.count("data:image/svg+xml") == 3
