import pytest

from falsifier.errors import ModelError
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


REFUSING = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from pathlib import Path
from falsifier.errors import SpecError
from falsifier.fmu import nursery, readiness
def refuse(tell):
    raise SpecError("must compile")
readiness.load_first = refuse
nursery.main(Path(sys.argv[3]))
"""


def test_what_keeps_the_nursery_from_starting_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(starting, "_BOOT", REFUSING)
    nursery = forking.Nursery()
    with pytest.raises(ModelError, match=r"^must compile$"):
        nursery.end(1 << 30)
    nursery.close()
    assert capfd.readouterr() == ("", "")


def test_what_the_nursery_says_is_logged_and_is_not_the_answer(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(starting, "_BOOT", TALKING)
    nursery = forking.Nursery()
    assert nursery.end(1 << 30) == 7
    nursery.close()
    assert [record.getMessage() for record in caplog.records] == ["compiling"]
