from falsifier.core.model import ModelInfo, Variable
from falsifier.fmu import Connection, Coupling, Frame, System, read_info
from falsifier.views.model_text import diagram_text, info_text, model_json
from tests.fmu.fixtures import path
from tests.fmu.small_systems import LOOP, component, system


def test_all_variables_of_a_large_model_have_a_line_each() -> None:
    many = tuple(Variable(f"plant.x[{k}]", start=float(k)) for k in range(20_000))
    info = ModelInfo("large", variables=many)
    lines = info_text(info, everything=True).splitlines()
    assert len([line for line in lines if line.startswith("plant.x[")]) == 20_000
    assert info_text(info).splitlines()[-1] == "... and 19940 more; --all shows all other variables"
    assert len(model_json(info)["variables"]) == 20_000


def test_unbounded_inputs_are_said_to_be_so() -> None:
    lines = info_text(read_info(path("HugeLimits_2"))).splitlines()
    (row,) = [line for line in lines if line.startswith("u ")]
    assert row.split() == ["u", "real", "m", "unbounded", "unbounded", "0"]


def test_the_text_says_order_ports_units_connections_and_what_is_late() -> None:
    links = {**LOOP, "pi.measured": Connection("plant.y", factor=0.5, offset=-1.0, extrapolation="linear")}
    model = system({"pi": component("Gain_2", 0.2), "plant": "Plant_2"}, links)
    assert (
        diagram_text(model)
        == """\
system: 2 components, in the order in which they step (gauss-seidel)

 1 plant  (Plant_2.fmu, co-simulation)
     u [m]  <-  pi.y  (late)
     y [m]  ->  pi.measured

 2 pi  (Gain_2.fmu, co-simulation, every 0.2 s)
     r [m]         <-  not connected
     measured [m]  <-  plant.y * 0.5 -1 (extrapolated)
     y [m]         ->  plant.u

(late): the value of the previous communication point"""
    )


def test_with_jacobi_all_connections_are_late_except_for_inputs_of_the_whole() -> None:
    whole = Frame((Variable("s", causality="input", unit="m"),))
    model = System(
        {"a": path("Plant_2"), "b": path("Plant_2")},
        {"a.u": "s", "b.u": "a.y"},
        frame=whole,
        coupling=Coupling("jacobi"),
    )
    text = diagram_text(model)
    assert "input of the system: s -> a.u" in text and "u [m]  <-  s\n" in text
    assert "u [m]  <-  a.y  (late)" in text


def test_iterated_loops_are_named_and_one_component_has_no_order() -> None:
    model = system({"plant": "Lead_2", "pi": "Gain_2"}, LOOP, Coupling(loops="iterate"))
    text = diagram_text(model)
    assert "plant, pi: repeated until the outputs agree" in text and "late" not in text
    single = diagram_text(system({"a": "Plant_2"}, {}))
    assert single.startswith("system: 1 component (gauss-seidel)")
