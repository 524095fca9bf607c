"""Both ways of starting workers keep the same promises."""

import os
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from falsifier.errors import SimulationError, SpecError
from falsifier.fmu import FmuModel
from falsifier.fmu.isolation import REGISTRY, IsolatedFmu
from falsifier.fmu.ways import VARIABLE, workers_fork
from tests import patience
from tests.fmu.fixtures import isolated, run
from tests.fmu.support import ALLOCATE, CRASH, HANG, assert_nothing_is_left, script

FINE = list(range(11))


@pytest.fixture(scope="module", params=["fork", "spawn"])
def way(request: pytest.FixtureRequest) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, request.param)
        patch.setenv("SOME_API_KEY", "hidden-1")
        REGISTRY.close()
        yield request.param
        REGISTRY.close()


@pytest.fixture(scope="module")
def misdeeds(way: str) -> FmuModel:
    return isolated("Misdeeds_2")


def worker_of(model: FmuModel) -> IsolatedFmu:
    (found,) = [fmu for key, fmu in REGISTRY._fmus.items() if key[0] == model.sha256]
    assert found._worker is not None
    return found


def failure(model: FmuModel, misdeed: int, time_limit: float = patience.HANG) -> SimulationError:
    with pytest.raises(SimulationError) as caught:
        run(model, ("y",), parameters={"misdeed": misdeed}, time_limit=time_limit)
    return caught.value


def test_each_fmu_has_a_worker_of_its_own_without_secrets(misdeeds: FmuModel) -> None:
    other = isolated("Lag_2")
    assert run(misdeeds, ("y",))["y"].tolist() == FINE
    assert len(run(other, ("y",))) == 11
    pids = {worker_of(model)._worker.pid for model in (misdeeds, other)}  # type: ignore[union-attr]
    assert len(pids) == 2
    if sys.platform == "linux" and os.access(f"/proc/{min(pids)}/environ", os.R_OK):
        assert all("hidden" not in Path(f"/proc/{pid}/environ").read_text() for pid in pids)
    other.close()


def test_too_much_memory_is_refused(misdeeds: FmuModel) -> None:
    error = failure(misdeeds, ALLOCATE)
    assert error.status == "failed" and "no memory for the table" in str(error)


def test_a_crash_is_told_with_its_signal(misdeeds: FmuModel) -> None:
    error = failure(misdeeds, CRASH)
    assert error.status == "crashed" and "signal SIGSEGV" in str(error)


def test_a_hang_ends_at_the_time_limit(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    assert failure(misdeeds, HANG, time_limit=0.3).status == "timeout"


def test_a_worker_that_was_killed_is_replaced(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    worker = worker_of(misdeeds)._worker
    assert worker is not None
    os.kill(worker.pid, signal.SIGTERM)
    assert worker.sock.recv(1, socket.MSG_PEEK) in (b"", b"\xf0"), "it is gone"
    assert run(misdeeds, ("y",))["y"].tolist() == FINE


def test_interrupts_reach_this_process_and_not_the_worker(way: str) -> None:
    body = """
import signal, threading
try:
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    go(2)
except KeyboardInterrupt:
    print("interrupted", go())
"""
    with script(body) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "interrupted 10.0\n"


def test_a_worker_that_hangs_ends_with_its_parent(way: str, tmp_path: Path) -> None:
    body = """
from falsifier.fmu.isolation import REGISTRY
(fmu,) = REGISTRY._fmus.values()
import threading
threading.Timer(0.3, os.kill, (os.getpid(), 9)).start()
print(fmu._worker.pid, flush=True)
go(2)
"""
    with script(body, TMPDIR=str(tmp_path)) as process:
        assert process.stdout is not None
        pid = int(process.stdout.read())
    assert_nothing_is_left(tmp_path)
    patience.wait_until(lambda: not Path(f"/proc/{pid}").exists())


def test_anything_else_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "thread")
    with pytest.raises(SpecError, match="FALSIFIER_WORKERS is 'thread'; expected fork or spawn"):
        workers_fork()


def test_the_forked_way_is_for_systems_with_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "fork")
    monkeypatch.setattr("falsifier.core.operating_system.HAS_FORK", False)
    with pytest.raises(SpecError, match="this system cannot fork processes"):
        workers_fork()
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setattr("falsifier.core.operating_system.FORKS_BY_DEFAULT", False)
    assert not workers_fork()
