from collections.abc import Callable

import pytest

from falsifier.fmu import Coupling
from falsifier.fmu.library import Library
from tests.fmu import small_systems as systems
from tests.fmu.small_systems import system


def test_states_of_iterated_steps_are_freed_before_their_instances(monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    look_up = Library.function

    def function(library: Library, name: str, *types: object) -> Callable[..., int]:
        called.append((library.description.info.name, name))
        return look_up(library, name, *types)

    monkeypatch.setattr(Library, "function", function)
    model = system({"plant": "Lead_2", "pi": "Gain_3"}, systems.LOOP, Coupling(loops="iterate"))
    for interval in (0.1, 0.2):
        systems.run(model, "plant.y", interval=interval, parameters={"pi.k": 1.0})
    model.close()
    for component, name in (("plant", "FreeFMUstate"), ("pi", "FreeFMUState")):
        of_states = [n for c, n in called if c == component and n in (name, "FreeInstance")]
        assert of_states == [name] * (len(of_states) - 1) + ["FreeInstance"]
        assert len(of_states) > 2, "one for each plan"
