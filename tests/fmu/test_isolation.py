"""What happens when an FMU misbehaves in its worker, and what is left behind afterwards."""

import os
import re
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread

import pytest

from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.forking import Nursery
from falsifier.fmu.isolation import _MOST_OF_A_THREAD, REGISTRY, IsolatedFmu, _Registry
from falsifier.fmu.spawning import Spawner
from falsifier.fmu.worker_order import Order
from tests import patience
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, run
from tests.fmu.support import (
    ABORT,
    ALLOCATE,
    CRASH,
    DISCARD,
    END,
    ERROR,
    EXIT,
    FORKED,
    HANG,
    NAN,
    PRINT,
    TALK,
    assert_nothing_is_left,
    script,
)


@pytest.fixture
def misdeeds() -> Iterator[FmuModel]:
    model = isolated("Misdeeds_2")
    yield model
    model.close()


def commit(model: FmuModel, misdeed: int, *, time_limit: float = patience.HANG) -> SimulationError:
    with pytest.raises(SimulationError) as caught:
        run(model, ("y",), parameters={"misdeed": misdeed}, time_limit=time_limit)
    assert run(model, ("y",))["y"].tolist() == list(range(11)), "the next simulation runs"
    return caught.value


@pytest.mark.parametrize(
    ("misdeed", "status", "reason"),
    [
        (CRASH, "crashed", "signal SIGSEGV"),
        (ABORT, "crashed", "signal SIGABRT; its last message: assertion failed: pressure > 0"),
        (EXIT, "crashed", "it exited with code 7"),
        (ALLOCATE, "failed", "the step returned error at t = 0.5 s.*no memory for the table"),
        (NAN, "failed", "output 'y' is nan at t = 0.6 s"),
        (DISCARD, "failed", "the step returned discard at t = 0.5 s, before the stop time 1 s"),
        (END, "failed", "the step returned discard at t = 0.5 s"),
        (ERROR, "failed", "the step returned error at t = 0.5 s.*the tank is empty"),
    ],
)
def test_misdeeds_are_failed_simulations(misdeeds: FmuModel, misdeed: int, status: str, reason: str) -> None:
    error = commit(misdeeds, misdeed)
    assert error.status == status
    assert error.args[0].startswith("Misdeeds: ")
    assert re.search(reason, str(error))


@pytest.mark.parametrize("name", ["Misdeeds_1cs", "Misdeeds_3"])
@pytest.mark.parametrize(("misdeed", "status"), [(CRASH, "crashed"), (DISCARD, "failed"), (END, "failed")])
def test_in_other_versions_too(name: str, misdeed: int, status: str) -> None:
    model = isolated(name)
    assert commit(model, misdeed).status == status
    model.close()


def test_ending_with_the_last_step_is_a_full_trajectory() -> None:
    model = isolated("Misdeeds_3")
    got = run(model, ("y",), parameters={"misdeed": END, "moment": 0.9})
    assert got["y"].tolist() == list(range(11))
    model.close()


def test_an_endless_loop_is_stopped_at_the_time_limit(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    error = commit(misdeeds, HANG, time_limit=0.3)
    assert error.status == "timeout" and "time limit of 0.3 s" in str(error)


def test_messages_of_failed_and_of_successful_simulations_are_kept(misdeeds: FmuModel) -> None:
    assert commit(misdeeds, ERROR).log == ("error: the tank is empty",)
    got = run(misdeeds, ("y",), parameters={"misdeed": TALK, "moment": 0.85})
    assert got.log == ("warning: valve nearly closed",)
    got = run(misdeeds, ("y",), parameters={"misdeed": PRINT, "moment": 0.75})
    assert got.log == ("solver: step halved",) * 2
    assert run(misdeeds, ("y",)).log == ()


def test_a_worker_that_dies_between_simulations_is_replaced_without_blame(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    run(misdeeds, ("y",))
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == misdeeds.sha256]
    assert fmu._worker is not None
    os.kill(fmu._worker.pid, signal.SIGKILL)
    assert fmu._worker.sock.recv(1, socket.MSG_PEEK) == b"", "it is gone"
    assert run(misdeeds, ("y",))["y"][-1] == 10


@FORKED
def test_a_nursery_that_dies_is_replaced(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    nursery = REGISTRY.starter()
    assert isinstance(nursery, Nursery)
    os.kill(nursery._process.pid, signal.SIGKILL)
    nursery._process.wait(patience.HANG)
    assert commit(misdeeds, CRASH).status == "crashed"
    assert REGISTRY.starter() is not nursery


def test_a_forked_copy_starts_workers_of_its_own(tmp_path: Path) -> None:
    body = """
pid = os.fork()
if not pid:
    print(go(), flush=True)
    os._exit(0)
os.waitpid(pid, 0)
print(go(), flush=True)
"""
    with script(body, TMPDIR=str(tmp_path)) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "10.0\n10.0\n"
    assert_nothing_is_left(tmp_path)


def test_interrupting_a_simulation_leaves_no_stale_answer() -> None:
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


def test_closing_the_registry_removes_the_folder_of_this_process() -> None:
    run(isolated("Lag_2"), ("y",))
    starter = REGISTRY.starter()
    assert isinstance(starter, Nursery | Spawner)
    root = starter._root
    assert root.is_dir()
    REGISTRY.close()
    assert not root.exists()
    assert len(run(isolated("Lag_2"), ("y",))) == 11


def orders(number: int) -> list[Order]:
    description = read_description(fixtures.path("Lag_2"))
    return [Order(Path("Lag"), f"{k:064d}", description, "co-simulation", None) for k in range(number)]


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> list[IsolatedFmu]:
    """What a registry ends from here on, in this order."""
    found: list[IsolatedFmu] = []
    monkeypatch.setattr(IsolatedFmu, "close", lambda fmu: found.append(fmu))
    return found


def test_workers_of_ended_threads_are_ended_when_another_is_needed(ended: list[IsolatedFmu]) -> None:
    registry, (order,) = _Registry(), orders(1)
    made: list[IsolatedFmu] = []
    thread = Thread(target=lambda: made.append(registry.fmu(order)))
    thread.start()
    thread.join()
    assert not ended
    here = registry.fmu(order)
    assert ended == made
    assert registry.fmu(order) is here
    registry.close()


def test_workers_of_living_threads_are_kept(ended: list[IsolatedFmu]) -> None:
    registry, asked, goes_on = _Registry(), Event(), Event()

    def go() -> None:
        one = registry.fmu(orders(1)[0])
        asked.set()
        goes_on.wait(patience.HANG)
        assert registry.fmu(orders(1)[0]) is one
        goes_on.clear()

    thread = Thread(target=go)
    thread.start()
    assert asked.wait(patience.HANG)
    registry.fmu(orders(2)[1])
    assert not ended
    goes_on.set()
    thread.join()
    assert not goes_on.is_set()
    registry.close()


def test_a_thread_keeps_the_workers_of_its_latest_fmus(ended: list[IsolatedFmu]) -> None:
    registry = _Registry()
    made = [registry.fmu(order) for order in orders(_MOST_OF_A_THREAD + 3)]
    assert ended == made[:3]
    registry.close()
