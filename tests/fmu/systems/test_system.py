from pathlib import Path
from typing import Any

import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.errors import ModelError, SpecError
from falsifier.fmu import Component, Coupling, System
from tests.fmu.fixtures import altered, path
from tests.fmu.small_systems import LOOP, component, loop, pids, run, sampled_loop, system


def test_a_connected_input_cannot_be_driven() -> None:
    with pytest.raises(ModelError, match=r"'plant\.u' is not an input, .*; the inputs are: pi\.r"):
        run(loop(), "plant.y", signals={"plant.u": Signal((0.0,), (1.0,))})


def test_own_steps_are_whole_multiples_of_the_communication_step() -> None:
    model = system({"plant": "Plant_2", "pi": component("Gain_2", 0.25)}, LOOP)
    with pytest.raises(
        SpecError, match=r"components\.pi\.step: step = 0\.25 s is not .* 0\.1 s; try step_size = 0\.05$"
    ):
        run(model, "plant.y")
    with pytest.raises(
        SpecError, match=r"0\.25 s is not .* output_interval = 0\.1 s; try output_interval = "
    ):
        model.check_steps(Experiment(1.0, 0.1, ("plant.y",)))
    model.check_steps(Experiment(1.0, 0.1, ("plant.y",), step_size=0.05))


def test_what_is_not_a_system_is_refused() -> None:
    with pytest.raises(SpecError, match="components: expected at least one FMU"):
        System({})
    with pytest.raises(SpecError, match=r"coupling\.method: expected gauss-seidel or jacobi"):
        loop(Coupling("both"))  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"nowhere\.fmu: cannot be read"):
        System({"a": "nowhere.fmu"})


def test_in_a_worker_it_simulates_the_same_and_a_component_that_crashes_is_named() -> None:
    model = system({"plant": "Plant_2", "pi": "Gain_2", "bad": "Misdeeds_2"}, LOOP)
    found = []
    for _ in range(3):
        assert run(model, "plant.x")["plant.x"] == pytest.approx(sampled_loop(0), abs=1e-9)
        found += pids(model)
    assert len(found) == 3 and len(set(found)) == 1
    with pytest.raises(Exception, match=r"crashed in component bad at t = 0.5 s: signal SIGSEGV") as crash:
        run(model, "plant.x", parameters={"bad.misdeed": 1})
    assert getattr(crash.value, "status", "") == "crashed"
    with pytest.raises(Exception, match=r"^bad: the step returned error at t = 0\.5 s.*the tank is empty"):
        run(model, "plant.x", parameters={"bad.misdeed": 9})


def test_variables_have_the_names_of_their_components() -> None:
    info = loop(pi="Gain_3").info
    assert [v.name for v in info.inputs] == ["pi.r"]
    assert [v.name for v in info.outputs] == ["plant.y", "pi.y"]
    assert [v.name for v in info.parameters] == ["plant.T", "plant.gain", "pi.k"]
    assert info["plant.u"].causality == "local" and not info["plant.u"].settable
    assert info.fmi_version == "2.0 and 3.0"
    assert info.components == ("plant", "pi") and info.noun == "system"
    assert info.description == "System of plant, pi. Connections: pi.y -> plant.u, plant.y -> pi.measured"


def test_all_names_of_a_connected_input_are_taken() -> None:
    info = system({"a": "Plant_2", "b": "Aliases_3"}, {"b.u": "a.y"}).info
    assert [v.name for v in info.inputs] == ["a.u"]
    assert info["b.plant.u"].causality == "local"


@pytest.mark.parametrize(
    ("steps", "expected"), [((0.02, 0.05), 0.01), ((1 / 30, 0.01), 1 / 300), ((0.04, 0.02), 0.02)]
)
def test_the_default_step_divides_the_steps_of_the_components(
    steps: tuple[float, float], expected: float
) -> None:
    a, b = (component("Plant_2", step) for step in steps)
    assert system({"a": a, "b": b}, {}).info.step_size == pytest.approx(expected)


def test_the_default_step_is_no_longer_than_that_of_an_fmu_without_a_step_of_its_own() -> None:
    fmus = Path(__file__).resolve().parents[3] / "fmus"
    parts = {"car": Component(str(fmus / "ATCar.fmu")), "shift": Component(fmus / "ATShift.fmu", 0.04)}
    assert System(parts).info.step_size == pytest.approx(0.01)


def test_the_steps_of_a_system_are_multiples_of_the_internal_steps_of_its_components(tmp_path: Path) -> None:
    def with_step(name: str, step: bytes) -> Path:
        stated = b'<CoSimulation fixedInternalStepSize="' + step + b'"'
        target = tmp_path / f"{name}.fmu"
        return altered(path("Echo_3"), target, lambda text: text.replace(b"<CoSimulation", stated))

    fmus = {"a": with_step("a", b"0.02"), "b": with_step("b", b"0.05")}
    info = System({**fmus, "c": path("Plant_2")}, {}).info
    assert info.internal_step == pytest.approx(0.1) and info.step_size == pytest.approx(0.1)
    own = System({"a": Component(fmus["a"], 0.02), "b": fmus["b"]}, {}).info
    assert own.internal_step is None, "what somebody stated decides"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"components": {"a": 5}}, "components: a: expected a Component or the path of an FMU, got 5"),
        ({"connections": {"a.u": 5}}, "connections: a.u: expected an output or a Connection, got 5"),
        ({"coupling": "jacobi"}, "coupling: expected a Coupling such as"),
    ],
)
def test_what_is_no_part_of_a_system_is_named(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(SpecError, match=f"^{said}"):
        System(**{"components": {"a": path("Plant_2")}, **arguments})
