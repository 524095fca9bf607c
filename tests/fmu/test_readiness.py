import sys
from collections.abc import Callable

import numba
import pytest

from falsifier.fmu import FmuModel, machine_code, master, readiness
from falsifier.fmu.readiness import Loops
from falsifier.fmu.simulator import _order
from tests.core.children import in_child
from tests.fmu.fixtures import ME, path


def test_the_user_hears_of_a_compilation_before_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[str] = []
    compiled: Callable[[float], float] = numba.njit(lambda x: 2.0 * x)

    def load(name: str, tell: Callable[[], None]) -> None:
        tell()
        heard.append(f"{name} is compiled")

    monkeypatch.setattr(machine_code, "load", load)
    monkeypatch.setattr(master, "warm_up", lambda: heard.append(f"twice 2 is {compiled(2.0):g}"))
    readiness.load_first(heard.append)
    assert heard == ["compiling the loops that step FMUs, once per installation", "co_simulation is compiled"]
    loops = Loops()
    loops._once("master", master.warm_up, lambda: heard.append("compiling"))
    assert heard[2:] == ["compiling", "twice 2 is 4"]
    Loops()._once("master", master.warm_up, lambda: heard.append("compiling"))
    assert heard[4:] == ["twice 2 is 4"]  # nothing is compiled, and nothing is said


def test_loops_are_loaded_only_if_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded: list[str] = []
    monkeypatch.setattr(machine_code, "load", lambda name, _tell: loaded.append(name))
    monkeypatch.setattr(master, "warm_up", lambda: loaded.append("master"))
    loops = Loops()
    loops.load(_order(FmuModel(path("Lag_2"))), print)
    assert not loaded
    for _ in range(2):
        loops.load(_order(FmuModel(path("Lag_2"), ME)), print)
    assert set(loaded) == {"model_exchange"}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux")
def test_a_worker_settles_in_its_folder_with_limited_memory(tmp_path: object) -> None:
    code = f"""
from pathlib import Path
from falsifier.fmu import readiness
readiness._MEMORY_SHARE = 1e-3
readiness.settle_in(Path({str(tmp_path)!r}))
print(os.getcwd())
try:
    bytearray(1 << 33)
except MemoryError:
    print("refused")
"""
    assert in_child(code) == f"{tmp_path}\nrefused\n"
