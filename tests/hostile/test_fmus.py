"""FMUs that attack the processes around them: each attack is at most one failed simulation."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from falsifier.core import posix
from falsifier.core.literals import printable
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SimulationError
from falsifier.fmu import FmuModel
from tests import patience
from tests.fmu.fixtures import isolated, path, run, worker
from tests.fmu.support import assert_nothing_is_left, python

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")

# As in tests/fixtures/fmus/src/hostile.h.
NOTHING, READ_SECRETS, FORK, FORK_AND_CRASH, FORGE, NEST, FLOOD = range(7)
ESCAPES, KILL, CLOSE, SEEK, CRASH, RESIZE = range(7, 13)
NAMES = ["Hostile_1cs", "Hostile_2", "Hostile_3"]


@pytest.fixture
def hostile() -> Iterator[FmuModel]:
    model = isolated("Hostile_2")
    yield model
    model.close()


def attack(model: FmuModel, misdeed: int, variant: int = 0) -> Trajectory | SimulationError:
    try:
        return run(model, ("y",), parameters={"misdeed": misdeed, "variant": variant})
    except SimulationError as error:
        return error


def still_simulates(model: FmuModel) -> bool:
    return bool(run(model, ("y",))["y"].tolist() == list(range(11)))


def have_ended(pids: list[int]) -> bool:
    """Wait until all of these processes have ended."""
    patience.wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))
    return True


def children(log: tuple[str, ...]) -> list[int]:
    """Process ids in a log; one is repeated if a child has a copy of what its parent had not yet written."""
    return list(dict.fromkeys(int(line.split()[-1]) for line in log if "child" in line))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("misdeed", [FORGE, ESCAPES, CLOSE, CRASH, RESIZE])
def test_an_attack_costs_at_most_one_simulation(name: str, misdeed: int) -> None:
    model = isolated(name)
    attack(model, misdeed)
    assert still_simulates(model)
    model.close()


ATTACKS = st.tuples(
    st.sampled_from([NOTHING, FORGE, FLOOD, ESCAPES, KILL, CLOSE, SEEK, CRASH, RESIZE]), st.integers(0, 5)
)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(ATTACKS, min_size=1, max_size=5))
def test_after_any_attacks_simulations_are_right(attacks: list[tuple[int, int]]) -> None:
    model = isolated("Hostile_2")
    for misdeed, variant in attacks:
        found = attack(model, misdeed, variant)
        assert all(line == printable(line) for line in found.log)
        assert sum(map(len, found.log)) < 100_000
    assert still_simulates(model)
    model.close()


@pytest.mark.parametrize("variant", range(6))
def test_a_forged_reply_is_a_failed_simulation(hostile: FmuModel, variant: int) -> None:
    found = attack(hostile, FORGE, variant)
    assert isinstance(found, SimulationError)
    assert found.status == "crashed" and "disturbed the replies" in str(found)
    assert still_simulates(hostile)


def test_messages_and_output_cannot_act_on_the_terminal(hostile: FmuModel) -> None:
    found = attack(hostile, ESCAPES)
    assert set(found.log) == {"printed", "warning: said\ufffd"}


def test_output_without_end_fills_neither_memory_nor_messages(hostile: FmuModel) -> None:
    found = attack(hostile, FLOOD)
    assert found.log[-1] == "(further output was dropped)"
    assert sum(map(len, found.log)) < 100_000
    assert os.fstat(worker(hostile).output.file.fileno()).st_size <= 1 << 20


def test_descriptors_of_this_process_are_not_kept_by_what_watches_an_fmu(tmp_path: Path) -> None:
    """Nor by Wine, which that process becomes."""
    model = isolated("Hostile_2")
    with (tmp_path / "open").open("w") as file:
        os.set_inheritable(file.fileno(), True)
        run(model, ("y",))
    found = Path(f"/proc/{worker(model).program.pid}/fd").iterdir()
    assert str(tmp_path / "open") not in map(os.readlink, found)
    model.close()


def test_what_an_fmu_forks_ends_with_its_process(hostile: FmuModel) -> None:
    pids = children(attack(hostile, FORK).log)
    assert len(pids) == 35
    hostile.close()
    assert have_ended(pids)


def test_what_an_fmu_forks_is_ended_after_a_crash_which_is_noticed(hostile: FmuModel) -> None:
    found = attack(hostile, FORK_AND_CRASH)
    assert isinstance(found, SimulationError)
    # The children keep the connection open; the crash is noticed all the same.
    assert found.status == "crashed" and "signal SIGSEGV" in str(found)
    pids = children(found.log)
    assert len(pids) == 35
    assert have_ended(pids)
    assert still_simulates(hostile)


SCRIPT = """
import os, sys
from falsifier.errors import FalsifierError
from falsifier.fmu import FmuModel
from falsifier.core.experiment import Experiment
model = FmuModel(sys.argv[1], allow=[f"write:{sys.argv[2]}"])
def go(misdeed=0, time_limit=60.0):
    experiment = Experiment(1.0, 0.1, ("y",), None, None, time_limit)
    return model.simulate({}, {"misdeed": misdeed}, experiment)
def tried(misdeed=0, time_limit=60.0):
    try:
        return go(misdeed, time_limit)["y"][-1]
    except FalsifierError as error:
        return f"{type(error).__name__} {getattr(error, 'status', '')}: {error}"
"""


def script(body: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a process that simulates, with a folder for temporary files, and one in which the FMU counts."""
    counting = folder / "counting"
    counting.mkdir(exist_ok=True)
    environment["FALSIFIER_FMU_VARIABLES"] = "HOSTILE_FMU, HOSTILE_COUNT"
    environment |= {"TMPDIR": str(folder), "HOSTILE_COUNT": str(counting / "count")}
    return python(SCRIPT + body, str(path("Hostile_2")), str(counting), **environment)


def test_shared_memory_that_is_resized_while_an_fmu_is_loaded_does_no_harm(tmp_path: Path) -> None:
    done = script("print(tried(), tried())", tmp_path, HOSTILE_FMU="resize")
    assert (done.returncode, done.stdout) == (0, "10.0 10.0\n")


def test_a_tree_of_folders_is_removed(tmp_path: Path) -> None:
    assert script(f"print(tried({NEST}), tried())", tmp_path).stdout == "10.0 10.0\n"
    assert not list(tmp_path.glob("falsifier-fmu-*"))


def test_children_end_and_folders_are_swept_when_the_simulating_process_is_killed(tmp_path: Path) -> None:
    body = f"print(*go({FORK}).log, sep='\\n', flush=True)\nos.kill(os.getpid(), 9)"
    pids = children(tuple(script(body, tmp_path).stdout.splitlines()))
    assert len(pids) == 35
    assert have_ended(pids)
    assert_nothing_is_left(tmp_path)


@pytest.mark.skipif(
    not posix.can_confine() and os.getuid() != 0, reason="processes of other programs cannot be protected"
)
def test_an_fmu_reads_no_secrets_of_other_processes(tmp_path: Path) -> None:
    environment = {"SOME_API_KEY": "hostile-test-secret-1", "LICENSE": "port@host"}
    holder = subprocess.Popen(["sleep", "1000"], env={**os.environ, **environment})
    try:
        assert script(f"print(tried({READ_SECRETS}))", tmp_path, **environment).stdout == "0.0\n"
    finally:
        holder.kill()
        holder.wait()


UNCONFINED = """
from falsifier.core import posix
posix.can_confine = lambda: False
import ctypes
go()
print(ctypes.CDLL(None).prctl(3, 0, 0, 0, 0))
"""


def test_where_fmus_cannot_be_confined_a_process_with_secrets_hides_its_memory(tmp_path: Path) -> None:
    assert script(UNCONFINED, tmp_path, SOME_API_KEY="hidden").stdout == "0\n"


# The worker is gone when the next simulation starts, without a failure that would be repeated at once.
GONE = """
from falsifier.fmu.process.registry import REGISTRY
print(tried())
next(iter(REGISTRY._runners.values())).close()
"""


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("crash", "crashed: .*crashed while it was loaded"),
        ("exit", "crashed: .*crashed while it was loaded"),
        ("hang", r"timeout: .*hung for 2 s \(time_limit\) while it was loaded"),
    ],
)
def test_a_replacement_that_does_not_load_is_a_failed_simulation(tmp_path: Path, how: str, says: str) -> None:
    limit = 2.0 if how == "hang" else 60.0
    body = GONE + f"print(tried(0, {limit}), tried(), sep='\\n')"
    first, replacement, last = script(body, tmp_path, HOSTILE_FMU=f"{how}-2").stdout.splitlines()
    assert (first, last) == ("10.0", "10.0")
    assert re.match(f"SimulationError {says}", replacement)


@pytest.mark.parametrize(
    ("how", "says"), [("crash", "crashed"), ("hang", "hung for 2 s"), ("exit", "crashed")]
)
def test_an_fmu_that_never_loads_is_unusable(tmp_path: Path, how: str, says: str) -> None:
    done = script("print(tried(0, 2.0))", tmp_path, HOSTILE_FMU=how)
    assert done.stdout.startswith("ModelError")
    assert re.search(f"the FMU('s process)? {says}", done.stdout)
