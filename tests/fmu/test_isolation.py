"""What happens when an FMU misbehaves in its worker, and what is left behind afterwards."""

import os
import pickle
import re
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import FmuModel, worker
from falsifier.fmu.isolation import REGISTRY
from falsifier.fmu.library import Library
from tests.command import listen_to_interrupts
from tests.fmu import fixtures
from tests.fmu.fixtures import isolated, local, run

NOTHING, CRASH, HANG, EXIT, ALLOCATE, NAN, DISCARD, END, ABORT, ERROR, TALK, PRINT = range(12)


@pytest.fixture
def misdeeds() -> Iterator[FmuModel]:
    model = isolated("Misdeeds_2")
    yield model
    model.close()


def commit(model: FmuModel, misdeed: int, *, time_limit: float = 60.0) -> SimulationError:
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
    started = time.perf_counter()
    error = commit(misdeeds, HANG, time_limit=0.3)
    assert error.status == "timeout" and "time limit of 0.3 s" in str(error)
    assert time.perf_counter() - started < 3.0


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
    time.sleep(0.05)
    assert run(misdeeds, ("y",))["y"][-1] == 10


def test_a_nursery_that_dies_is_replaced(misdeeds: FmuModel) -> None:
    run(misdeeds, ("y",))
    nursery = REGISTRY.nursery()
    nursery._process.kill()
    nursery._process.wait()
    assert commit(misdeeds, CRASH).status == "crashed"
    assert REGISTRY.nursery() is not nursery


@pytest.mark.parametrize(
    ("name", "reuse"),
    [
        ("Lag_2", "reset"),
        ("NoReset_2", "instance"),
        ("LyingReset_2", "instance"),
        ("SavedState_2", "state"),
        ("SavedState_3", "state"),
        ("LyingState_2", "instance"),
        ("SpentState_3", "instance"),
        ("KeepsStatic_2", "library"),
    ],
)
def test_repeated_runs_are_equal_whatever_the_reset_does(name: str, reuse: str) -> None:
    model = isolated(name)
    runs = [run(model, ("y",))["y"].tolist() for _ in range(4)]
    assert runs == [runs[0]] * 4
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
    assert fmu._trust.reuse == reuse
    model.close()


def test_workers_are_replaced_before_they_have_made_too_many_instances() -> None:
    model = isolated("NoReset_2")
    pids = set()
    for _ in range(worker._MAX_INSTANCES + 20):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
        (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
        pids |= {fmu._worker.pid} if fmu._worker else set()
    assert len(pids) == 2
    model.close()


@pytest.mark.parametrize("name", ["SavedState_2", "SavedState_3"])
def test_thousands_of_runs_start_from_one_saved_state_in_one_worker(name: str) -> None:
    model = isolated(name)
    run(model, ("y",), stop=0.2)
    run(model, ("y",), stop=0.2)  # takes note of the self-test
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
    assert fmu._worker is not None
    pid = fmu._worker.pid
    for _ in range(5 * worker._MAX_INSTANCES):
        assert run(model, ("y",), stop=0.2)["y"].tolist() == [0, 1, 2]
    assert fmu._worker is not None and fmu._worker.pid == pid
    model.close()


def test_a_saved_state_is_taken_once_and_freed_before_its_instance(monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    look_up = Library.function

    def function(library: Library, name: str, *types: object) -> Callable[..., int]:
        called.append(name)
        return look_up(library, name, *types)

    monkeypatch.setattr(Library, "function", function)
    model = local("SavedState_3")
    for _ in range(3):
        run(model, ("y",))
    model.close()
    kept = [name for name in called if "FMUState" in name or name == "FreeInstance"]
    tested, used = ["SetFMUState"] * 2, ["SetFMUState"] * 2
    # The first instance goes after its reset was found to be none.
    assert kept == ["FreeInstance", "GetFMUState", *tested, *used, "FreeFMUState", "FreeInstance"]


def test_models_travel_between_processes_and_are_equal_by_content(tmp_path: Path) -> None:
    model = isolated("Lag_2")
    twin = pickle.loads(pickle.dumps(model))
    assert twin == model and hash(twin) == hash(model)
    assert run(twin, ("y",))["y"].tolist() == run(model, ("y",))["y"].tolist()
    assert isolated("Lag_3") != model
    assert FmuModel(model.path, "model-exchange") != model


def test_a_file_that_changes_after_loading_is_refused(tmp_path: Path) -> None:
    copy = tmp_path / "model.fmu"
    copy.write_bytes(fixtures.path("Lag_3").read_bytes())
    with zipfile.ZipFile(copy, "a") as archive:
        archive.writestr("resources/note.txt", "another file than the others")
    model = FmuModel(copy)
    copy.write_bytes(fixtures.path("Ball_3").read_bytes())
    with pytest.raises(ModelError, match=r"model\.fmu: the file has changed since the model was loaded"):
        run(model, ("y",))


def test_no_binary_for_this_platform_says_what_there_is_and_what_to_do() -> None:
    with pytest.raises(
        ModelError, match=r"no binary for .*no binaries at all; .*compile them with `falsifier build`"
    ):
        run(isolated("Lag_2sources"), ("y",))


SCRIPT = """
import os, sys, time
from pathlib import Path
from falsifier.fmu import FmuModel
from falsifier.core.model import Experiment
model = FmuModel(sys.argv[1])
experiment = Experiment(1.0, 0.1, ("y",))
def go(misdeed=0):
    return model.simulate({}, {"misdeed": misdeed}, experiment)["y"][-1]
go(); go()
"""


def script(body: str, **environment: str) -> subprocess.Popen[str]:
    """Start a process that simulates."""
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT + body, str(fixtures.path("Misdeeds_2"))],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        preexec_fn=listen_to_interrupts,
    )


def leftovers(folder: Path) -> list[str]:
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline and list(folder.glob("falsifier-fmu-*")):
        time.sleep(0.05)
    return [p.name for p in folder.glob("falsifier-fmu-*")]


@pytest.mark.parametrize("ending", ["", "go(1)", "os.kill(os.getpid(), 9)", "os._exit(3)"])
def test_folders_and_processes_are_gone_however_the_process_ends(tmp_path: Path, ending: str) -> None:
    with script("print('ran', flush=True)\n" + ending, TMPDIR=str(tmp_path)) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "ran\n"
    assert leftovers(tmp_path) == []


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
    assert leftovers(tmp_path) == []


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


def test_interrupting_a_simulation_leaves_no_stale_answer() -> None:
    body = """
import signal, threading
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    go(2)
except KeyboardInterrupt:
    print("interrupted", go())
"""
    with script(body) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "interrupted 10.0\n"


def test_closing_the_registry_removes_the_folder_of_this_process() -> None:
    run(isolated("Lag_2"), ("y",))
    root = REGISTRY.nursery()._root
    assert root.is_dir()
    REGISTRY.close()
    assert not root.exists()
    assert len(run(isolated("Lag_2"), ("y",))) == 11
