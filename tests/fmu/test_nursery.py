from pathlib import Path

import pytest

from falsifier.fmu import isolation
from falsifier.fmu.nursery import REAP
from tests.fmu.support import assert_nothing_is_left, script


@pytest.mark.parametrize("ending", ["", "go(1)", "os.kill(os.getpid(), 9)", "os._exit(3)"])
def test_folders_and_processes_are_gone_however_the_process_ends(tmp_path: Path, ending: str) -> None:
    with script("print('ran', flush=True)\n" + ending, TMPDIR=str(tmp_path)) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "ran\n"
    assert_nothing_is_left(tmp_path)


def test_fmu_processes_see_no_secrets(tmp_path: Path) -> None:
    body = """
from falsifier.fmu.isolation import REGISTRY
(fmu,) = REGISTRY._fmus.values()
for pid in (fmu._worker.pid, REGISTRY._nursery._process.pid):
    print(Path(f"/proc/{pid}/environ").read_text().replace(chr(0), chr(10)))
"""
    with script(
        body, SOME_API_KEY="hidden-1", GH="ghp_hidden2hidden2hidden2", LICENSE="port@host"
    ) as process:
        assert process.stdout is not None
        seen = process.stdout.read()
    assert "hidden" not in seen
    assert seen.count("LICENSE=port@host") == 2


# A nursery that says something, and then the exit code of the worker that it is asked for.
TALKING = f"""
import json, socket, sys
sys.path[:] = json.loads(sys.argv[1])
from falsifier.fmu.channel import Reply, receive_request, send_reply
sock = socket.socket(fileno=int(sys.argv[2]))
send_reply(sock, Reply())
assert receive_request(sock)[0] == {REAP}
send_reply(sock, Reply(text="compiling", more=True))
send_reply(sock, Reply(text="7"))
"""


def test_what_the_nursery_says_is_logged_and_is_not_the_answer(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(isolation, "_BOOT", TALKING)
    nursery = isolation.Nursery()
    assert nursery.reap(1) == 7
    nursery.close()
    assert [record.getMessage() for record in caplog.records] == ["compiling"]
