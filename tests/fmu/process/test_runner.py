"""What happens when an FMU misbehaves in its worker, and what is left behind afterwards."""

import os
import re
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Thread

import pytest

from falsifier.fmu import FmuModel
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.registry import _MOST_OF_A_THREAD, Registry
from falsifier.fmu.process.runner import Runner
from tests import patience
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, ramp, run, worker
from tests.fmu.support import (
    ABORT,
    ALLOCATE,
    CRASH,
    DISCARD,
    END,
    ERROR,
    EXIT,
    HANG,
    NAN,
    PRINT,
    TALK,
    assert_nothing_is_left,
    commit,
    script,
)

# As in session.c.
_MOST_INSTANCES = 400


@pytest.fixture
def misdeeds() -> Iterator[FmuModel]:
    model = isolated("Misdeeds_2")
    yield model
    model.close()


@pytest.mark.parametrize(
    ("misdeed", "status", "reason"),
    [
        (CRASH, "crashed", "crashed at t = 0.5 s: signal SIGSEGV"),
        (ABORT, "crashed", "signal SIGABRT; its last message: assertion failed: pressure > 0"),
        (EXIT, "crashed", "it exited with code 7"),
        (ALLOCATE, "failed", "the step returned error at t = 0.5 s.*no memory for the table"),
        (NAN, "failed", "output 'y' is nan at t = 0.6 s; omit it if no formula names it"),
        (DISCARD, "failed", "the step returned discard at t = 0.5 s, before the stop time 1 s"),
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
    assert commit(isolated(name), misdeed).status == status


@pytest.mark.parametrize("name", ["Misdeeds_2", "Misdeeds_3"])
def test_an_fmu_that_ends_the_simulation_early_is_told_with_its_time(name: str) -> None:
    model = isolated(name)
    assert "terminated the simulation at t = 0.6 s" in str(commit(model, END))
    assert run(model, ("y",), parameters={"misdeed": END, "moment": 0.9})["y"].tolist() == list(range(11))


def test_an_endless_loop_is_stopped_at_the_time_limit(misdeeds: FmuModel, at_the_command_line: None) -> None:
    run(misdeeds, ("y",))
    error = commit(misdeeds, HANG, time_limit=0.3)
    assert error.status == "timeout"
    assert "limit of 0.3 s; slow models need a larger --time-limit, or time_limit in a spec" in str(error)


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
    os.kill(worker(misdeeds).program.pid, signal.SIGKILL)
    patience.wait_until(lambda: not worker(misdeeds).program.is_alive)
    assert run(misdeeds, ("y",))["y"][-1] == 10


def test_each_fmu_has_a_worker_of_its_own_without_secrets(
    misdeeds: FmuModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOME_API_KEY", "hidden")
    other = isolated("Ball_2")
    assert len(run(misdeeds, ("y",))) == len(run(other, ("h",))) == 11
    pids = {worker(model).program.pid for model in (misdeeds, other)}
    assert len(pids) == 2
    if sys.platform == "linux":
        assert all("hidden" not in Path(f"/proc/{pid}/environ").read_text() for pid in pids)


def test_a_worker_that_hangs_ends_with_its_parent(tmp_path: Path) -> None:
    body = """
from falsifier.fmu.process.registry import REGISTRY
(runner,) = REGISTRY._runners.values()
import threading
threading.Timer(0.3, os.kill, (os.getpid(), 9)).start()
print(runner._worker.program.pid, flush=True)
go(2)
"""
    pid = int(script(body, TMPDIR=str(tmp_path)))
    patience.wait_until(lambda: not Path(f"/proc/{pid}").exists())
    assert_nothing_is_left(tmp_path)


def test_a_simulation_in_a_background_thread_does_not_delay_the_end(tmp_path: Path) -> None:
    body = """
import threading
experiment = Experiment(1.0, 0.1, ("y",), None, None, 1e6)
threading.Thread(target=go, args=(2,), daemon=True).start()
time.sleep(0.3)
print("end", flush=True)
"""
    assert script(body, TMPDIR=str(tmp_path)) == "end\n"
    assert_nothing_is_left(tmp_path)


def test_a_forked_copy_starts_workers_of_its_own(tmp_path: Path) -> None:
    body = """
pid = os.fork()
if not pid:
    print(go(), flush=True)
    os._exit(0)
os.waitpid(pid, 0)
print(go(), flush=True)
"""
    assert script(body, TMPDIR=str(tmp_path)) == "10.0\n10.0\n"
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
    assert script(body) == "interrupted 10.0\n"


def orders(number: int) -> list[Order]:
    return [replace(isolated("Lag_2").order, key=k) for k in range(number)]


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> list[Runner]:
    """What a registry ends from here on, in this order."""
    found: list[Runner] = []
    monkeypatch.setattr(Runner, "close", lambda fmu: found.append(fmu))
    return found


def test_workers_of_ended_threads_are_ended_when_another_is_needed(ended: list[Runner]) -> None:
    registry, (order,) = Registry(), orders(1)
    made: list[Runner] = []
    thread = Thread(target=lambda: made.append(registry.runner(order)))
    thread.start()
    thread.join()
    assert not ended
    here = registry.runner(order)
    assert ended == made
    assert registry.runner(order) is here
    registry.close()


def test_a_thread_keeps_the_workers_of_its_latest_fmus(ended: list[Runner]) -> None:
    registry = Registry()
    made = [registry.runner(order) for order in orders(_MOST_OF_A_THREAD + 3)]
    assert ended == made[:3]
    registry.close()


def test_workers_are_replaced_before_they_have_made_too_many_instances() -> None:
    model = isolated("NoReset_2")
    pids = set()
    for _ in range(_MOST_INSTANCES + 20):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
        found = fixtures.runner(model)._worker
        pids |= {found.program.pid} if found else set()
    assert len(pids) == 2


@pytest.mark.parametrize("name", ["SavedState_2", "SavedState_3"])
def test_thousands_of_runs_start_from_one_saved_state_in_one_worker(name: str) -> None:
    model = isolated(name)
    run(model, ("y",), stop=0.2)
    run(model, ("y",), stop=0.2)  # takes note of the self-test
    pid = worker(model).program.pid
    for _ in range(5 * _MOST_INSTANCES):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
    assert worker(model).program.pid == pid


@pytest.mark.parametrize(
    ("name", "reuse"),
    [
        ("Lag_2", "reset"),
        ("NoReset_2", "instance"),
        ("LyingReset_2", "instance"),
        ("CrashesAtEnd_2", None),
        ("SavedState_2", "state"),
        ("SavedState_3", "state"),
        ("LyingState_2", "instance"),
        ("SpentState_3", "instance"),
        ("KeepsStatic_2", "library"),
    ],
)
def test_the_cheapest_way_that_gives_the_same_again_is_found(name: str, reuse: str | None) -> None:
    model = isolated(name)
    signals = {v.name: ramp(1.0) for v in model.info.inputs}
    found, pids = [], set()
    for _ in range(6):
        found.append(run(model, ("y",), signals=signals)["y"].tolist())
        runner = fixtures.runner(model)
        pids |= {runner._worker.program.pid} if runner._worker else set()
    assert found == [found[0]] * 6 and found[0][-1] > 0
    assert runner.reuse == reuse
    assert reuse != "library" or len(pids) == 1, "even a library that is loaded again costs no process"
