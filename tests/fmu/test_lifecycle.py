from collections.abc import Callable
from pathlib import Path

import pytest

from falsifier.core.model import Experiment, Interface
from falsifier.errors import SimulationError
from falsifier.fmu.description import archive
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.library import Library
from falsifier.fmu.lifecycle import Lifecycle, make_lifecycle
from falsifier.fmu.plan import Plan, make_plan
from tests.fmu import fixtures

ALL: list[tuple[str, Interface]] = [
    ("Lag_1cs", "co-simulation"),
    ("Lag_1me", "model-exchange"),
    ("Lag_2", "co-simulation"),
    ("Lag_2", "model-exchange"),
    ("Lag_3", "co-simulation"),
    ("Lag_3", "model-exchange"),
]


def started(name: str, interface: Interface, folder: Path) -> tuple[Library, Lifecycle, Plan]:
    path = fixtures.path(name)
    archive.extract(path, folder)
    description = read_description(path)
    library = Library(description, folder, interface, lambda _: None)
    plan = make_plan(description, Experiment(1.0, 0.1, (), tolerance=1e-4), [], [])
    return library, make_lifecycle(library), plan


@pytest.mark.parametrize(("name", "interface"), ALL)
def test_parameters_are_set_before_inputs_and_both_before_the_first_step(
    name: str, interface: Interface, tmp_path: Path
) -> None:
    library, lifecycle, plan = started(name, interface, tmp_path)
    done: list[str] = []
    lifecycle.initialise(plan, lambda: done.append("parameters"), lambda: done.append("inputs"))
    assert done == ["parameters", "inputs"]
    lifecycle.terminate()
    library.close()


@pytest.mark.parametrize(("name", "interface"), ALL)
def test_a_reset_instance_can_start_again(name: str, interface: Interface, tmp_path: Path) -> None:
    library, lifecycle, plan = started(name, interface, tmp_path)
    lifecycle.initialise(plan, lambda: None, lambda: None)
    lifecycle.terminate()
    was_reset = lifecycle.reset()
    assert was_reset == (name != "Lag_1me"), "FMI 1 model exchange has no reset"
    if was_reset:
        lifecycle.initialise(plan, lambda: None, lambda: None)
    library.close()


def test_a_refusal_at_the_start_names_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library, lifecycle, plan = started("Lag_2", "co-simulation", tmp_path)
    look_up = Library.function

    def function(self: Library, name: str, *types: object) -> Callable[..., int]:
        return (lambda *_: 3) if name == "ExitInitializationMode" else look_up(self, name, *types)

    monkeypatch.setattr(Library, "function", function)
    with pytest.raises(SimulationError, match="Lag: ExitInitializationMode returned error") as caught:
        lifecycle.initialise(plan, lambda: None, lambda: None)
    assert caught.value.time == 0.0
    library.close()


def test_only_fmi_1_model_exchange_tells_of_events_at_its_start(tmp_path: Path) -> None:
    for number, (name, interface) in enumerate(ALL):
        library, lifecycle, plan = started(name, interface, tmp_path / str(number))
        lifecycle.initialise(plan, lambda: None, lambda: None)
        assert (lifecycle.first_events is not None) == (name == "Lag_1me")
        library.close()
