"""What is checked of a system before anything is simulated: every error names both ends."""

import re

import pytest

from falsifier.errors import SpecError
from falsifier.fmu import Connection, Coupling, System
from falsifier.fmu.description import wine
from tests.fmu import fixtures
from tests.fmu.small_systems import LOOP, solved, system

PAIR = {"plant": "Plant_2", "pi": "Gain_2"}
ECHO = {"a": "Echo_3", "b": "Echo_3"}
WRONG: list[tuple[dict[str, str], dict[str, str | Connection], str]] = [
    (PAIR, {"plnt.u": "pi.y"}, "pi.y -> plnt.u: no component of the name in 'plnt.u'.*did you mean 'plant'"),
    (PAIR, {"plant.u": "y"}, "y -> plant.u: no component of the name in 'y'.*COMPONENT.VARIABLE"),
    (PAIR, {"plant.v": "pi.y"}, "pi.y -> plant.v: plant has no input 'v'; .*known: u"),
    (PAIR, {"plant.u": "pi.z"}, "pi.z -> plant.u: pi has no output 'z'; .*known: y"),
    (PAIR, {"plant.T": "pi.y"}, "pi.y -> plant.T: plant.T is not an input, its causality is parameter"),
    (PAIR, {"plant.u": "pi.r"}, "pi.r -> plant.u: pi.r is not an output, its causality is input"),
    ({"a": "Arrays_3", "b": "Plant_2"}, {"a.u": "b.y"}, "b.y -> a.u: b.y has 1 elements, a.u has 2"),
    ({"a": "Echo_2", "b": "Plant_2"}, {"a.in_Integer": "b.y"}, "type real, the input of type integer"),
    (ECHO, {"b.in_Int8": "a.out_Int16"}, "values from -32768 to 32767 do not fit the input, whose type Int8"),
    (ECHO, {"b.in_Boolean": "a.out_Int8"}, "type integer, the input of type boolean"),
    (
        {"plant": "Plant_2", "pi": "Gain_2kelvin"},
        LOOP,
        "plant.y -> pi.measured: the output is in m, the input in K, .* factor = NUMBER",
    ),
    (ECHO, {"b.in_Int8": Connection("a.out_Int8", factor=2.0)}, "type integer cannot be converted"),
    (ECHO, {"b.in_Int8": Connection("a.out_Int8", extrapolation="linear")}, "only continuous real inputs"),
    (PAIR, {"plant.u": Connection("pi.y", factor=float("nan"))}, "factor: expected a finite number"),
    (PAIR, {"plant.u": Connection("pi.y", factor=0.0)}, "connections: pi.y -> plant.u: factor = 0 passes"),
]


@pytest.mark.parametrize(("components", "connections", "message"), WRONG)
def test_a_connection_that_does_not_fit_is_refused_with_both_ends(
    components: dict[str, str], connections: dict[str, str | Connection], message: str
) -> None:
    with pytest.raises(SpecError, match=re.sub(r"\.(?!\*)", r"\\.", message)):
        system(components, connections)


def test_two_connections_to_one_input_are_both_named() -> None:
    arrays = {"a": "Arrays_3", "b": "Arrays_3", "c": "Plant_2"}
    with pytest.raises(SpecError, match=r"c\.y -> b\.u\[2\]: this input is already connected: a\.y -> b\.u;"):
        system(arrays, {"b.u": "a.y", "b.u[2]": "c.y"})


def test_interfaces_and_versions_without_communication_steps_are_refused() -> None:
    with pytest.raises(SpecError, match=r"components\.a: .*Scheduled_3\.fmu: the FMU offers neither"):
        system({"a": "Scheduled_3"}, {})
    with pytest.raises(SpecError, match=r"components\.a\.interface: the FMU offers co-simulation, not model"):
        system({"a": solved("Gain_2")}, {})
    with pytest.raises(SpecError, match=r"components\.a: .*Lag_1cs\.fmu: an FMU of FMI 1 has no init"):
        system({"a": "Lag_1cs"}, {})


def test_components_that_cannot_restore_their_state_do_not_iterate() -> None:
    iterate = Coupling(loops="iterate")
    with pytest.raises(
        SpecError, match=r'coupling\.loops: loops = "iterate" repeats .* plant, pi, but plant cannot'
    ):
        system({"plant": "Lag_2", "pi": "Gain_2"}, LOOP, iterate)
    assert system({"plant": "Lag_2", "pi": "Plant_2"}, {"plant.u": "pi.y"}, iterate).network.loops == ()
    with pytest.raises(
        SpecError, match=r'coupling\.loops: with the method "jacobi" every connection has a delay'
    ):
        system(PAIR, LOOP, Coupling("jacobi", "iterate"))


def test_units_are_converted_and_the_conversion_is_told() -> None:
    found = system({"plant": "Plant_2", "pi": "Gain_2mm"}, LOOP)
    (link,) = [n for n in found.network.links if n.target.name == "measured"]
    assert (link.factor, link.offset) == (1000.0, 0.0)
    assert "plant.y -> pi.measured: converted from m to mm: * 1000" in found.info.notes
    stated = {**LOOP, "pi.measured": Connection("plant.y", offset=273.15)}
    (link,) = [
        n
        for n in system({"plant": "Plant_2", "pi": "Gain_2kelvin"}, stated).network.links
        if n.target.name == "measured"
    ]
    assert (link.factor, link.offset) == (1.0, 273.15)


def test_a_unit_that_is_missing_is_told() -> None:
    notes = system({"a": "Misdeeds_2", "b": "Plant_2"}, {"b.u": "a.y"}).info.notes
    assert "a.y -> b.u: passes unchanged; the output states no unit, the input is in m" in notes


def test_an_output_may_feed_several_inputs_and_arrays_go_element_by_element() -> None:
    found = system({"a": "Arrays_3", "b": "Arrays_3", "c": "Plant_2"}, {"b.u": "a.y", "c.u": "a.y[2]"})
    assert found.info.connections == (("a.y[1]", "b.u[1]"), ("a.y[2]", "b.u[2]"), ("a.y[2]", "c.u"))


def test_components_with_a_windows_library_only_are_refused() -> None:
    path = fixtures.FOLDER / "win64" / "Lag_2.fmu"
    if not wine.can_run_windows():
        pytest.skip("on this machine it is refused as an FMU without a library")
    with pytest.raises(SpecError, match=r"its only library is for Windows; .* not as a component"):
        System({"lag": path}, {})
