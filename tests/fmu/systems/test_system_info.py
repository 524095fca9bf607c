from pathlib import Path

import pytest

from falsifier.fmu import Component, System
from tests.fmu.fixtures import path
from tests.fmu.small_systems import component, loop, system


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


def test_without_steps_of_their_own_the_smallest_default_counts() -> None:
    assert loop().info.step_size == 0.01
    assert loop().info.stop_time == 10.0


def test_components_whose_names_make_two_variables_equal_are_refused() -> None:
    aliases = Component(Path(path("Aliases_3")))  # has a variable plant.u
    with pytest.raises(Exception, match=r"two variables of the system are named 'a\.plant\.u'"):
        System({"a": aliases, "a.plant": path("Plant_2")})
