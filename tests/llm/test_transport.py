import subprocess
import sys
import threading
from contextvars import ContextVar
from functools import partial
from pathlib import Path

import httpx
import pytest

from falsifier.llm.transport import RefusedReplyError, guarded_client, within
from tests.hostile.servers import hangs, misbehaving, response, sends
from tests.patience import HANG

PLACE: ContextVar[str] = ContextVar("PLACE", default="nowhere")


def test_it_returns_or_raises_what_the_action_does_in_the_callers_context() -> None:
    token = PLACE.set("here")
    try:
        assert within(HANG, PLACE.get) == "here"
    finally:
        PLACE.reset(token)
    with pytest.raises(ZeroDivisionError):
        within(HANG, lambda: 1 // 0)


def test_a_process_ends_although_a_call_was_given_up_while_it_imported(tmp_path: Path) -> None:
    # What the interpreter's own lock for imports does in a thread that is stopped at the wrong moment.
    slow = "import _imp, time\n_imp.acquire_lock()\ntime.sleep(0.4)\n_imp.release_lock()\n"
    closes = "class Closing:\n    def __del__(self):\n        import colorsys\nclosing = Closing()\n"
    main = (
        "import holder\n"
        "from contextlib import suppress\n"
        "from falsifier.llm.transport import within\n"
        "with suppress(TimeoutError):\n"
        "    within(0.1, lambda: __import__('slow'))\n"
    )
    for name, source in (("slow", slow), ("holder", closes), ("main", main)):
        (tmp_path / f"{name}.py").write_text(source)
    subprocess.run(
        [sys.executable, "main.py"], cwd=tmp_path, timeout=HANG, check=True, stderr=subprocess.DEVNULL
    )


def test_a_request_after_the_end_is_refused() -> None:
    given_up, outcome = threading.Event(), list[object]()

    def late() -> None:
        given_up.wait(HANG)
        try:
            outcome.append(guarded_client().get(server.root))
        except httpx.HTTPError as error:
            outcome.append(error)

    with misbehaving(sends(response(b"{}"))) as server:
        with pytest.raises(TimeoutError, match=r"no complete reply within 0\.05 s"):
            within(0.05, late)
        given_up.set()
        waiting = threading.Event()
        while not outcome:
            waiting.wait(0.01)
        assert not server.requests
    assert "the call has ended" in str(outcome[0])


def test_a_length_above_the_limit_is_refused_before_it_is_read() -> None:
    head = b"HTTP/1.1 200 OK\r\ncontent-length: 99999999999\r\n\r\n"
    with misbehaving(hangs(head)) as server, pytest.raises(RefusedReplyError, match="more than 16 MiB"):
        within(HANG, lambda: guarded_client().get(server.root, timeout=HANG))


def test_cookies_are_not_kept() -> None:
    with misbehaving(sends(response(b"{}", headers="set-cookie: a=b\r\n"))) as server:
        client = guarded_client()
        for _ in range(2):
            within(HANG, lambda: client.get(server.root))
    assert all(b"a=b" not in sent for sent in server.requests)


def test_nothing_is_sent_to_a_host_or_with_a_key_that_is_another_ones() -> None:
    with pytest.raises(RefusedReplyError, match=r"it would have gone to api\.openai\.com; state the address"):
        within(HANG, lambda: guarded_client().get("http://api.openai.com"), never={"api.openai.com"})
    for headers in ({"Authorization": "Bearer sk-1"}, {"api-key": "sk-1"}):
        send = partial(guarded_client().get, "http://127.0.0.1:9", headers=headers)
        with pytest.raises(RefusedReplyError, match="it would have got A's key") as caught:
            within(HANG, send, withheld={"sk-1": "A's key"})
        assert "sk-1" not in str(caught.value)
