"""Parameter bindings: inline and in files, prefixes, mappings, and which of two values wins."""

from pathlib import Path

import pytest

from falsifier.errors import SpecError
from falsifier.fmu import read_package
from tests.fmu.fixtures import altered, path
from tests.fmu.packages import NAMESPACES, PI, PLANT, structure, system, values, write


def bindings(*each: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(each)}</ssd:ParameterBindings>"


def inline(*parameters: str, prefix: str = "") -> str:
    stated = f"<ssd:ParameterValues>{values(*parameters)}</ssd:ParameterValues>"
    return f'<ssd:ParameterBinding prefix="{prefix}">{stated}</ssd:ParameterBinding>'


def starts(file: Path) -> dict[str, float | str]:
    return dict(read_package(file).frame.values)


def test_outer_values_win_and_among_those_of_one_level_the_last(tmp_path: Path) -> None:
    own = PLANT.replace(
        "<ssd:Connectors>", bindings(inline("T Real 1", "gain Real 7")) + "<ssd:Connectors>", 1
    )
    outer = bindings(inline("plant.T Real 2"), inline("T Real 3", prefix="plant."))
    file = write(tmp_path / "p.ssp", structure(system(own, before=outer)), "Plant_2")
    assert starts(file) == {"plant.T": 3.0, "plant.gain": 7.0}


def test_sets_and_mappings_are_read_from_files(tmp_path: Path) -> None:
    entries = """<ssm:MappingEntry source="a" target="plant.T">
        <ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>"""
    mapping = f'<ssm:ParameterMapping {NAMESPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    bound = '<ssd:ParameterBinding source="resources/p.ssv"><ssd:ParameterMapping source="resources/m.ssm"/>'
    ssd = structure(system(PLANT + PI, before=bindings(bound + "</ssd:ParameterBinding>")))
    more: dict[str, str | bytes] = {
        "resources/p.ssv": values("a Real 4", "pi.k Real 9"),
        "resources/m.ssm": mapping,
    }
    file = write(tmp_path / "p.ssp", ssd, "Plant_2", "Gain_2", more=more)
    assert starts(file) == {"plant.T": 9.0}, "with a mapping, only what it names"
    more["resources/m.ssm"] = mapping.replace('"a"', '"b"')
    with pytest.raises(SpecError, match=r"the system: a mapping names the unknown parameter 'b'"):
        read_package(write(tmp_path / "p.ssp", ssd, "Plant_2", "Gain_2", more=more))
    more["resources/p.ssv"] = values("a Real x")
    with pytest.raises(SpecError, match=r"p\.ssp: resources/p\.ssv: the parameter a: value: 'x' is not"):
        read_package(write(tmp_path / "p.ssp", ssd, "Plant_2", "Gain_2", more=more))


def test_units_types_and_names_that_mean_nothing(tmp_path: Path) -> None:
    def read(*parameters: str) -> dict[str, float | str]:
        ssd = structure(system(PLANT, before=bindings(inline(*parameters))))
        return starts(write(tmp_path / "p.ssp", ssd, "Plant_2"))

    assert read("plant.x Real 500 mm") == {"plant.x": 0.5}
    assert read("plant.T Integer 3") == {"plant.T": 3.0}
    assert read("plant.x Float64 3") == {"plant.x": 3.0}
    with pytest.raises(SpecError, match=r"the parameter plant\.x is in kg, 'plant\.x' in m"):
        read("plant.x Real 5 kg")
    with pytest.raises(SpecError, match=r"'abc' is a text, but 'plant\.T' is of type real"):
        read("plant.T String abc")
    ssd = structure(system(PLANT, before=bindings(inline("engine.T Real 1"))))
    model = read_package(write(tmp_path / "p.ssp", ssd, "Plant_2"))
    assert model.frame.values == ()
    assert "the parameter engine.T of the package names nothing that can be set" in model.info.notes


def test_a_value_has_the_units_of_the_fmu_that_it_is_for(tmp_path: Path) -> None:
    gain = altered(path("Gain_2mm"), tmp_path / "g.fmu", lambda x: x.replace(b'r="0.001"', b'r="0.004"'))
    one, two = (f'<ssd:Component name="{n}" source="resources/{n}.fmu"/>' for n in ("one", "two"))
    bound = bindings(inline("one.measured Real 1 m", "two.measured Real 1 m"))
    more: dict[str, str | bytes] = {
        "resources/one.fmu": path("Gain_2mm").read_bytes(),
        "resources/two.fmu": gain.read_bytes(),
    }
    file = write(tmp_path / "p.ssp", structure(system(one + two, before=bound)), more=more)
    assert starts(file) == {"one.measured": 1000.0, "two.measured": 250.0}


def test_a_connection_of_parameters_converts_the_value(tmp_path: Path) -> None:
    wire = """<ssd:Connection startConnector="p" endElement="plant" endConnector="T">
        <ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>"""
    port = '<ssd:Connector name="p" kind="parameter"><ssc:Real/></ssd:Connector>'
    before = f"<ssd:Connectors>{port}</ssd:Connectors>{bindings(inline('p Real 4'))}"
    ssd = structure(system(PLANT, wire, before=before))
    assert starts(write(tmp_path / "p.ssp", ssd, "Plant_2")) == {"plant.T": 9.0}


def test_the_value_of_a_connector_that_is_fed_is_replaced_without_a_note(tmp_path: Path) -> None:
    port = '<ssd:Connector name="p" kind="parameter"><ssc:Real/></ssd:Connector>'
    port = f"<ssd:Connectors>{port}</ssd:Connectors>"
    wire = '<ssd:Connection startConnector="p" endElement="plant" endConnector="T"/>'
    inner = system(PLANT, wire, before=port + bindings(inline("p Real 4")), name="body")
    outer = '<ssd:Connection startConnector="p" endElement="body" endConnector="p"/>'
    ssd = structure(system(inner, outer, before=port + bindings(inline("p Real 7"))))
    file = write(tmp_path / "p.ssp", ssd, "Plant_2")
    assert starts(file) == {"body.plant.T": 7.0}
    assert not any("names nothing" in note for note in read_package(file).info.notes)


def test_texts_and_items_of_enumerations_are_set(tmp_path: Path) -> None:
    table = '<ssd:Component name="t" source="resources/Table_2.fmu"/>'
    echo = '<ssd:Component name="e" source="resources/Echo_2.fmu"/>'
    bound = bindings(
        inline(
            "t.fileName String other.txt", "e.in_Enumeration Enumeration third", "e.in_Boolean Boolean true"
        )
    )
    ssd = structure(system(table + echo, before=bound))
    file = write(tmp_path / "p.ssp", ssd, "Table_2", "Echo_2")
    assert starts(file) == {"t.fileName": "other.txt", "e.in_Enumeration": 3.0, "e.in_Boolean": 1.0}
    assert read_package(file).info["e.in_Enumeration"].start == 3.0
    ssd = structure(system(echo, before=bindings(inline("e.in_Integer Real 2.5"))))
    with pytest.raises(SpecError, match=r"e\.in_Integer is 2\.5: expected an integer"):
        read_package(write(file, ssd, "Echo_2"))
