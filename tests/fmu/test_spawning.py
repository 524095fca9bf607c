from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import FmuModel, starting
from falsifier.fmu.isolation import REGISTRY
from falsifier.fmu.simulator import _order
from falsifier.fmu.spawning import Spawner
from falsifier.fmu.ways import VARIABLE
from falsifier.fmu.worker_order import Order
from tests.fmu import fixtures

# A program that is ready at once, and becomes no worker.
QUICK = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from falsifier.core.operating_system import receive_connection
from falsifier.fmu.channel import Reply, receive_request, send_reply
sock, _ = receive_connection()
send_reply(sock, Reply())
receive_request(sock)
ANSWER
receive_request(sock)
"""


def order() -> Order:
    return _order(FmuModel(fixtures.path("Lag_2")))


@pytest.fixture
def spawner(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Spawner]:
    answer = getattr(request, "param", "send_reply(sock, Reply())")
    monkeypatch.setattr(starting, "_BOOT", QUICK.replace("ANSWER", answer))
    found = Spawner()
    yield found
    found.close()
    assert not found._root.exists()


def test_a_program_waits_in_advance_once_a_second_one_was_needed(spawner: Spawner) -> None:
    first = spawner._spare
    assert first is not None
    assert spawner.start(order()).pid == first.pid
    assert spawner._spare is None
    second = spawner.start(order())
    waiting = spawner._spare
    assert waiting is not None and waiting.pid not in (first.pid, second.pid)
    waiting._child.end()
    third = spawner.start(order())
    assert third.pid != waiting.pid, "one that has ended is not used"
    assert spawner.end(second.pid) != 0
    assert spawner.end(second.pid) == 0, "it is known no more"


def test_what_cannot_be_unpacked_is_named(spawner: Spawner, tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"no zip")
    with pytest.raises(ModelError, match=r"broken\.fmu"):
        spawner.start(replace(order(), path=broken, sha256="of a broken file"))


@pytest.mark.parametrize(
    ("spawner", "says"),
    [
        ("send_reply(sock, Reply('unusable', 'no room'))", "^no room$"),
        (
            "print('no library', flush=True); sys.exit(4)",
            "has ended before it could load the FMU.*no library",
        ),
    ],
    indirect=["spawner"],
)
def test_a_program_that_becomes_no_worker_is_an_error(spawner: Spawner, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        spawner.start(order())
    assert not spawner._workers


@pytest.mark.parametrize(
    "spawner",
    ["send_reply(sock, Reply(text='compiling', more=True)); send_reply(sock, Reply())"],
    indirect=True,
)
def test_what_it_says_while_it_compiles_is_logged(spawner: Spawner, caplog: pytest.LogCaptureFixture) -> None:
    spawner.start(order())
    assert [record.getMessage() for record in caplog.records] == ["compiling"]


def test_trajectories_come_through_a_named_file_where_files_cannot_be_sent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(VARIABLE, "spawn")
    monkeypatch.setattr("falsifier.core.operating_system.SENDS_FILES", False)
    monkeypatch.setattr("falsifier.core.operating_system.send_descriptors", None)
    REGISTRY.close()
    model = fixtures.isolated("Misdeeds_2")
    assert fixtures.run(model, ("y",))["y"].tolist() == list(range(11))
    REGISTRY.close()
