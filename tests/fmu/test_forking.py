import pytest

from falsifier.fmu import forking, starting
from falsifier.fmu.nursery import REAP

# A nursery that says something, and then the exit code of the worker that it is asked for.
TALKING = f"""
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from falsifier.core.posix import receive_connection
from falsifier.fmu.channel import Reply, receive_request, send_reply
sock, _ = receive_connection()
send_reply(sock, Reply())
assert receive_request(sock)[0] == {REAP}
send_reply(sock, Reply(text="compiling", more=True))
send_reply(sock, Reply(text="7"))
"""


def test_what_the_nursery_says_is_logged_and_is_not_the_answer(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(starting, "_BOOT", TALKING)
    nursery = forking.Nursery()
    assert nursery.end(1 << 30) == 7
    nursery.close()
    assert [record.getMessage() for record in caplog.records] == ["compiling"]
