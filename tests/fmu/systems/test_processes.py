"""Components in processes of their own do what they do in one process, and end it as they end themselves."""

import sys
from pathlib import Path

import numpy as np
import pytest

from falsifier.core.signals import Signal
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import Component, Connection, Coupling
from tests.campaigns.test_kill import children
from tests.fmu.fixtures import altered, path
from tests.fmu.small_systems import LINEAR, LOOP, component, pids, run, solved, system
from tests.fmu.support import CRASH, HANG
from tests.patience import wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked, and end with a parent")
EACH = Coupling(isolation="each")
BAD = {**LOOP, "pi.r": "bad.y"}


@pytest.mark.parametrize(
    ("plant", "pi", "links", "coupling"),
    [
        ("Plant_2", component("Gain_3", 0.2), LINEAR, Coupling()),
        ("Plant_3", "Gain_2", LOOP, Coupling("jacobi")),
        ("Lead_3", "Gain_2", LOOP, Coupling(loops="iterate")),
        (solved("Lead_2"), "Gain_3", LINEAR, Coupling(loops="iterate")),
        (solved("Lag_3", 0.2), "Gain_2", LINEAR, Coupling("jacobi")),
    ],
)
def test_trajectories_are_those_of_one_process_to_the_last_digit(
    plant: str | Component, pi: str | Component, links: dict[str, str | Connection], coupling: Coupling
) -> None:
    """Also when instances are used again."""
    drive = {"pi.r": Signal((0.0, 0.35), (0.5, 1.5), "constant")}
    outputs = ("plant.y", "plant.x", "pi.y")
    found = []
    for isolation in ("together", "each"):
        both = Coupling(coupling.method, coupling.loops, isolation=isolation)
        model = system({"plant": plant, "pi": pi}, links, both)
        runs = [run(model, *outputs, signals=drive, parameters={"pi.k": gain}) for gain in (0.5, 0.25, 0.5)]
        np.testing.assert_array_equal(runs[0]["plant.y"], runs[2]["plant.y"])
        found.append([[each[name] for name in outputs] for each in runs])
        model.close()
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize("second", ["a.fmu", "b.fmu"])
def test_an_fmu_that_a_process_can_have_only_once_gets_one_per_component(second: str, tmp_path: Path) -> None:
    once = b'<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" '
    for name, known in (("a.fmu", "Lag_2"), ("b.fmu", "Lead_2")):
        altered(path(known), tmp_path / name, lambda x: x.replace(b"<CoSimulation ", once), ending=".xml")
    parts = {"a": Component(tmp_path / "a.fmu"), "b": Component(tmp_path / second)}
    model = system(parts, {"b.u": "a.y"})
    is_twice = second == "a.fmu"
    assert model.order.network.coupling.isolation == ("each" if is_twice else "together")
    assert ("because a and b are one FMU" in model.info.notes[-1]) == is_twice
    assert run(model, "b.x", signals={"a.u": Signal((0.0,), (1.0,))})["b.x"][-1] > 0.0


def test_libraries_that_must_be_loaded_again_cost_no_process_of_the_master() -> None:
    model = system({"a": solved("Lag_2"), "b": "KeepsStatic_2"}, {}, EACH)
    used = set()
    for _ in range(4):
        run(model, "a.y", "b.y")
        used |= set(pids(model))
    assert len(used) == 1


def test_a_component_that_crashes_or_hangs_is_named_and_the_next_simulation_works() -> None:
    model = system({"plant": "Plant_2", "pi": "Gain_2", "bad": "Misdeeds_2"}, BAD, EACH)
    run(model, "plant.y")
    (guard,) = pids(model)
    (worker,) = children(guard)
    others = children(worker)
    assert len(others) == 3
    for each in others:  # nothing but what every program has
        assert {file.name for file in Path(f"/proc/{each}/fd").iterdir()} == {"0", "1", "2"}
    with pytest.raises(SimulationError, match=r"crashed in component bad at t = 0.5 s: .*SIGSEGV") as failed:
        run(model, "plant.y", parameters={"bad.misdeed": CRASH})
    assert failed.value.status == "crashed"
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in others))
    assert run(model, "plant.y").times[-1] == 1.0
    with pytest.raises(SimulationError, match=r"in component bad .*time limit"):
        run(model, "plant.y", parameters={"bad.misdeed": HANG}, time_limit=0.5)


@pytest.mark.parametrize("coupling", [Coupling(), EACH])
def test_a_component_that_cannot_be_loaded_is_named(coupling: Coupling) -> None:
    with pytest.raises(ModelError, match=r"^system: second: instantiating the FMU failed"):
        run(system({"pi": "Gain_2", "second": "NeedsTool_2"}, {}, coupling), "pi.y")
