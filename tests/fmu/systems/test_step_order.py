import pytest

from falsifier.errors import SpecError
from falsifier.fmu import Coupling, System
from tests.fmu.small_systems import LOOP, system


def order(model: System) -> list[str]:
    network = model.network
    return [network.members[k].name for k in network.order]


@pytest.mark.parametrize(
    "components", [{"plant": "Plant_2", "pi": "Gain_3"}, {"pi": "Gain_2", "plant": "Plant_3"}]
)
def test_a_component_whose_output_depends_directly_steps_after_what_feeds_it(
    components: dict[str, str],
) -> None:
    found = system(components, LOOP)
    assert order(found) == ["plant", "pi"]
    assert "in the order plant, pi; plant.u uses the values of the previous" in found.info.notes[0]


def test_a_chain_of_direct_dependencies_has_no_delay() -> None:
    chain = {"a": "Gain_2", "b": "Gain_2", "c": "Plant_2"}
    found = system(chain, {"a.measured": "b.y", "b.measured": "c.y"})
    assert order(found) == ["c", "b", "a"]
    assert found.info.notes[0] == "components step in the order c, b, a"


def test_what_declares_nothing_may_depend_on_everything_unless_that_forbids_any_order() -> None:
    found = system({"last": "Lag_2", "first": "Plant_2"}, {"last.u": "first.y"})
    assert order(found) == ["first", "last"]
    both = system({"a": "Lag_2", "b": "Lag_2"}, {"a.u": "b.y", "b.u": "a.y"})
    assert order(both) == ["a", "b"], "neither declares anything: the order is the given one"


def test_a_loop_of_direct_dependencies_is_refused_with_its_variables() -> None:
    loop = {"a.measured": "b.y", "b.measured": "a.y"}
    gains = {"a": "Gain_2", "b": "Gain_3"}
    with pytest.raises(
        SpecError,
        match=r"connections: (a\.y -> b\.measured -> b\.y -> a\.measured -> a\.y|"
        r"b\.y -> a\.measured -> a\.y -> b\.measured -> b\.y): .*algebraic loop.* loops = \"delay\"",
    ):
        system(gains, loop)
    assert order(system(gains, loop, Coupling(loops="delay"))) == ["a", "b"]


def test_only_the_components_of_a_loop_iterate_and_stand_together() -> None:
    links = {"a.u": "b.y", "b.u": "a.y", "c.u": "a.y", "d.measured": "d.y", "b2.u": "c.y"}
    fmus = {"c": "Plant_2", "b": "Lead_2", "b2": "Lead_3", "d": "Gain_2", "a": "Lead_2"}
    found = system(fmus, links, Coupling(loops="iterate"))
    assert order(found) == ["c", "b2", "d", "b", "a"]
    assert found.network.loops == ((2, 3), (3, 5))
    notes = found.info.notes[:3]
    assert "c.u uses the values of the previous communication point" in notes[0], "it has no direct output"
    assert notes[1:] == (
        "d repeats its steps until the outputs no longer change",
        "b, a repeat their steps until the outputs no longer change",
    )


def test_an_output_that_feeds_its_own_component_directly_is_a_loop() -> None:
    with pytest.raises(SpecError, match=r"a\.y -> a\.measured -> a\.y: these depend directly"):
        system({"a": "Gain_2"}, {"a.measured": "a.y"})
    assert system({"a": "Plant_2"}, {"a.u": "a.y"}).info.inputs == ()
