import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import FmuModel, processes
from falsifier.fmu.nursery import REAP
from falsifier.fmu.processes import Nursery, WorkerProcess
from falsifier.fmu.worker_order import Order
from tests.fmu import fixtures


@pytest.fixture(scope="module")
def nursery() -> Iterator[Nursery]:
    owner = Nursery()
    yield owner
    owner.close()
    assert not owner.is_alive


def order() -> Order:
    path = fixtures.path("Lag_2")
    model = FmuModel(path)
    return Order(path, model.sha256, model._description, "co-simulation", None)


def test_a_worker_has_a_process_of_its_own_and_a_signal_as_its_end(nursery: Nursery) -> None:
    first, second = WorkerProcess(nursery, order()), WorkerProcess(nursery, order())
    assert first.pid != second.pid
    assert [first.kill(), second.kill()] == [-signal.SIGKILL] * 2


def test_what_cannot_be_unpacked_is_named(nursery: Nursery, tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"no zip")
    with pytest.raises(ModelError, match=r"broken\.fmu"):
        WorkerProcess(nursery, replace(order(), path=broken, sha256="of a broken file"))


def test_without_its_nursery_a_worker_ends_without_an_exit_code() -> None:
    owner = Nursery()
    worker = WorkerProcess(owner, order())
    owner.close()
    assert worker.kill() == 0


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
    monkeypatch.setattr(processes, "_BOOT", TALKING)
    nursery = processes.Nursery()
    assert nursery.reap(1) == 7
    nursery.close()
    assert [record.getMessage() for record in caplog.records] == ["compiling"]
