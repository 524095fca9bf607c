"""What is checked of a system before anything is simulated: every error names both ends."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Variable
from falsifier.errors import ModelError, SimulationError, SpecError
from falsifier.fmu import Component, Connection, Coupling, Frame, System
from falsifier.fmu.description import libraries
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.outcome import failure, last_lines
from falsifier.fmu.process.plan import make_plan
from tests.fmu import fixtures
from tests.fmu.small_systems import LOOP, solved, system

PAIR: dict[str, str | Component] = {"plant": "Plant_2", "pi": "Gain_2"}
ECHO: dict[str, str | Component] = {"a": "Echo_3", "b": "Echo_3"}
ARRAYS: dict[str, str | Component] = {"a": "Arrays_3", "b": "Arrays_3", "c": "Plant_2"}
WRONG: list[tuple[dict[str, str | Component], dict[str, str | Connection], str]] = [
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
        "plant.y -> pi.measured: the output is in m, the input in K, .* state factor and offset",
    ),
    (ECHO, {"b.in_Int8": Connection("a.out_Int8", factor=2.0)}, "type integer cannot be converted"),
    (ECHO, {"b.in_Int8": Connection("a.out_Int8", extrapolation="linear")}, "only continuous real inputs"),
    (PAIR, {"plant.u": Connection("pi.y", factor=0.0)}, "connections: pi.y -> plant.u: factor = 0 passes"),
    (ARRAYS, {"b.u": "a.y", "b.u[2]": "c.y"}, r"c.y -> b.u\[2\]: this input is already connected: a.y"),
    ({"a": "Scheduled_3"}, {}, "components.a: .*Scheduled_3.fmu: the FMU offers neither"),
    ({"a": solved("Gain_2")}, {}, "components.a.interface: the FMU offers co-simulation, not model"),
    ({"a": "Lag_1cs"}, {}, "components.a: .*Lag_1cs.fmu: an FMU of FMI 1 has no init"),
    ({"a": "Gain_2"}, {"a.measured": "a.y"}, "a.y -> a.measured -> a.y: these depend directly"),
]


@pytest.mark.parametrize(("components", "connections", "message"), WRONG)
def test_what_does_not_fit_is_refused_with_the_component_or_both_ends(
    components: dict[str, str | Component], connections: dict[str, str | Connection], message: str
) -> None:
    with pytest.raises(SpecError, match=re.sub(r"\.(?!\*)", r"\\.", message)):
        system(components, connections)


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
    found = system({"plant": "Plant_2", "pi": "Gain_2kelvin"}, stated)
    (link,) = [n for n in found.network.links if n.target.name == "measured"]
    assert (link.factor, link.offset) == (1.0, 273.15)


@pytest.mark.parametrize(("more", "offset"), [(b"", 273.15), (b' relativeQuantity="true"', 0.0)])
def test_offsets_do_not_move_differences(more: bytes, offset: float, tmp_path: Path) -> None:
    fmu = fixtures.altered(
        fixtures.path("Plant_2"),
        tmp_path / "p.fmu",
        lambda xml: xml.replace(b'unit="m"', b'unit="degC"' + more),
    )
    found = system({"a": Component(fmu), "b": "Gain_2kelvin"}, {"b.measured": "a.y"})
    assert [(n.factor, n.offset) for n in found.network.links] == [(1.0, offset)]


def test_a_unit_that_is_missing_is_told() -> None:
    notes = system({"a": "Misdeeds_2", "b": "Plant_2"}, {"b.u": "a.y"}).info.notes
    assert "a.y -> b.u: passes unchanged; the output states no unit, the input is in m" in notes


def test_an_output_may_feed_several_inputs_and_arrays_go_element_by_element() -> None:
    found = system(ARRAYS, {"b.u": "a.y", "c.u": "a.y[2]"})
    assert found.info.connections == (("a.y[1]", "b.u[1]"), ("a.y[2]", "b.u[2]"), ("a.y[2]", "c.u"))


def test_variables_of_two_types_may_have_the_same_reference(tmp_path: Path) -> None:
    """As OpenModelica writes them: FMI 2 counts the references of each type by themselves."""
    fmu = fixtures.altered(
        fixtures.path("Echo_2"),
        tmp_path / "e.fmu",
        lambda xml: xml.replace(b'"in_Integer" valueReference="1"', b'"in_Integer" valueReference="0"'),
    )
    parts: dict[str, str | Component] = {"a": "Echo_2", "b": Component(fmu)}
    links = {"b.in_Real": "a.out_Real"}
    assert "b.in_Integer" in [v.name for v in system(parts, links).info.inputs]
    assert len(system(parts, {**links, "b.in_Integer": "a.out_Integer"}).network.links) == 2


@pytest.mark.parametrize("name", ["Lag_2", "Stiff_2"], ids=["co-simulation", "model exchange"])
def test_components_with_a_windows_library_only_are_refused(name: str) -> None:
    path = fixtures.FOLDER / "win64" / f"{name}.fmu"
    if not libraries.can_run_windows():
        pytest.skip("on this machine it is refused as an FMU without a library")
    with pytest.raises(SpecError, match=r"its only library is for Windows; .* not as a component"):
        System({"a": path}, {})


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


def test_an_output_may_feed_its_own_component_if_that_delays_it() -> None:
    assert system({"a": "Plant_2"}, {"a.u": "a.y"}).info.inputs == ()


def test_an_input_of_the_whole_closes_no_loop() -> None:
    frame = Frame((Variable("r", causality="input", start=0.0),))
    links: dict[str, Connection | str] = {"first.r": Connection("r"), "last.measured": "first.y"}
    fmus = {name: fixtures.path("Gain_2") for name in ("first", "last")}
    found = System(fmus, links, coupling=Coupling(loops="iterate"), frame=frame)
    assert found.network.loops == () and order(found) == ["first", "last"]
    found = System(fmus, {"first.r": "r"}, coupling=Coupling("jacobi"), frame=frame)
    assert found.info.notes[0] == "components step in the order first, last", "it is not late either"


MODEL = system({"table": "Table_3", "plant": "Lead_2", "pi": "Gain_2"}, LOOP, Coupling(loops="iterate"))
STRINGS = (("table.fileName", "a.txt"),)
PLAN = make_plan(
    MODEL.network.description, Experiment(1.0, 0.1, ("plant.y",), strings=STRINGS), (), (), pieces=1
)


@pytest.mark.parametrize("where", [*Where, 77])
@pytest.mark.parametrize("text", ["", "x", "1 99 y -1 ٣ 1e999 nan", "9" * 5000])
@pytest.mark.parametrize("component", [-1, 2, 10**8])
def test_nonsense_is_no_defect(where: int, text: str, component: int) -> None:
    error = failure(MODEL.network, PLAN, Reply(where, 1 << 31, text, 0.5, component=component), "", ("slow",))
    assert isinstance(error, SimulationError | ModelError) and str(error)


def test_a_refused_first_step_tells_its_size() -> None:
    error = failure(MODEL.network, PLAN, Reply(Where.STEPPING, 3, time=0.0, component=0), "", ())
    assert "the first step, of " in str(error) and "needs it as step_size" in str(error)
    slow = replace(MODEL.network, members=tuple(replace(m, step=0.5) for m in MODEL.network.members))
    told = failure(slow, PLAN, Reply(Where.STEPPING, 3, time=0.0, component=0), "", ())
    assert re.search(r"the first step, of 0.5 s, .* needs it as components\.\w+\.step", str(told))
    about = {"Step of 1 s, not 2": True, "ValueError: a": False, "ok: set": True, "doStep failed": True}
    about["[doStep]\nValueError: a"] = False
    for text, is_about_steps in about.items():
        lines = tuple(text.split("\n"))
        said = str(failure(MODEL.network, PLAN, Reply(Where.STEPPING, 3, time=0.0, component=0), "", lines))
        assert ("needs it as step_size" in said) is is_about_steps and said.endswith(lines[-1])
    later = failure(MODEL.network, PLAN, Reply(Where.STEPPING, 3, time=0.5, component=0), "", ())
    assert "the step returned error at t = 0.5 s" in str(later)
    pending = failure(MODEL.network, PLAN, Reply(Where.STEPPING, 5, time=0.0, component=0), "", ())
    assert "in the background are not supported" in str(pending) and "step_size" not in str(pending)


def test_of_a_panic_its_reason_is_told_and_not_the_calls_that_led_there() -> None:
    panic = ("thread '<unnamed>' panicked at src/lib.rs:42:9:", "the tank is empty", "stack backtrace:")
    log = ("started", *panic, *(f"  {k}: std::panicking" for k in range(20)), "aborting")
    assert last_lines(log) == f"; its last messages: {'; '.join(panic)}"


def test_a_refused_first_step_names_the_option_that_there_is(at_the_command_line: None) -> None:
    error = failure(MODEL.network, PLAN, Reply(Where.STEPPING, 3, time=0.0, component=0), "", ())
    assert "needs it as --output-interval, or as step_size in a spec" in str(error)
