import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import FmuModel
from falsifier.fmu.forking import Nursery
from falsifier.fmu.processes import WorkerProcess
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
