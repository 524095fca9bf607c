"""SSP packages as systems."""

from pathlib import Path

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.signals import Signal
from falsifier.errors import SpecError
from falsifier.fmu import read_package
from falsifier.fmu.ssp import reader as ssp
from falsifier.problem.requirement import parse_requirement
from tests.fixtures.archives import packed
from tests.fmu.fixtures import altered, path
from tests.fmu.packages import FEEDBACK, PI, PLANT, structure, system, values, write
from tests.fmu.small_systems import run, sampled_loop

ROOT_PORTS = """<ssd:Connectors>
  <ssd:Connector name="reference" kind="input"><ssc:Real unit="mm"/></ssd:Connector>
  <ssd:Connector name="height" kind="output"><ssc:Real unit="m"/></ssd:Connector>
  <ssd:Connector name="slowness" kind="parameter"><ssc:Real/></ssd:Connector>
</ssd:Connectors>"""
PORTS = """
<ssd:Connection startConnector="reference" endElement="pi" endConnector="r"/>
<ssd:Connection startElement="plant" startConnector="y" endConnector="height"/>
<ssd:Connection startConnector="slowness" endElement="plant" endConnector="T"/>"""
SHIFT = '><ssc:LinearTransformation offset="9"/></ssd:Connection>'
MILLIMETRE = '<ssd:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssd:Units>'


@pytest.mark.parametrize("name", ["loop.ssp", "loop.ssd"])
@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_components_and_connections_make_a_system(name: str, version: str, tmp_path: Path) -> None:
    ssd = structure(system(PLANT + PI, FEEDBACK), version=version)
    model = read_package(write(tmp_path / name, ssd, "Plant_2", "Gain_2"))
    assert model.info.connections == (("pi.y", "plant.u"), ("plant.y", "pi.measured"))
    assert model.info.name == "root" and [v.name for v in model.info.inputs] == ["pi.r"]
    np.testing.assert_allclose(run(model, "plant.x")["plant.x"], sampled_loop(0), atol=1e-9)


def test_ports_of_the_whole_units_and_the_default_experiment(tmp_path: Path) -> None:
    bound = f"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{values('slowness Real 4')}"
    bound += "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    ssd = structure(
        system(PLANT + PI, FEEDBACK + PORTS, before=ROOT_PORTS + bound),
        after=MILLIMETRE + '<ssd:DefaultExperiment stopTime="3"/>',
    )
    model = read_package(write(tmp_path / "loop.ssp", ssd, "Plant_2", "Gain_2"))
    info = model.info
    assert info.stop_time == 3.0
    (reference,) = info.inputs
    assert (reference.name, reference.unit, reference.low, reference.high) == ("reference", "mm", 0.0, 2000.0)
    assert info["height"].alias_of == "plant.y" and info["plant.T"].start == 4.0
    signals = {"reference": Signal((0.0,), (1000.0,))}
    found = run(model, "height", "plant.y", "pi.r", signals=signals, parameters={"plant.T": 2.0})
    np.testing.assert_allclose(found["height"], sampled_loop(0), atol=1e-9)
    np.testing.assert_array_equal(found["plant.y"], found["height"])
    assert set(found["pi.r"]) == {1.0}
    slow = run(model, "height")["height"]  # the default reference is the controller's 1 m, and T is 4 s
    assert slow[1] == pytest.approx(2.0 * (1.0 - np.exp(-0.1 / 4.0)))
    given = run(model, "height", parameters={"reference": 500.0, "plant.T": 2.0})["height"]
    np.testing.assert_allclose(given, 0.5 * sampled_loop(0), atol=1e-9)


def test_nested_systems_are_flattened_and_transformations_add_up(tmp_path: Path) -> None:
    ports = """<ssd:Connectors>
      <ssd:Connector name="in" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>"""
    inner = system(
        PLANT,
        """<ssd:Connection startElement="plant" startConnector="u" endConnector="in">
             <ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>
           <ssd:Connection startElement="plant" startConnector="y" endConnector="out"/>""",
        before=ports,
        name="body",
    )
    ssd = structure(
        system(
            inner + PI,
            """<ssd:Connection startElement="pi" startConnector="y" endElement="body" endConnector="in">
                 <ssc:LinearTransformation factor="10" offset="3"/></ssd:Connection>
               <ssd:Connection startElement="body" startConnector="out" endElement="pi"
                               endConnector="measured" suppressUnitConversion="true"/>""",
        )
    )
    model = read_package(write(tmp_path / "nested.ssp", ssd, "Plant_2", "Gain_2"))
    assert model.info.components == ("body.plant", "pi")
    links = {n.target.name: n for n in model.network.links}
    assert (links["u"].factor, links["u"].offset) == (20.0, 7.0), "2 (10 y + 3) + 1"
    assert (links["measured"].factor, links["measured"].offset) == (1.0, 0.0)
    assert any(
        "pi.y -> body.plant.u: * 20 + 7, by units and transformations" in note for note in model.info.notes
    )


def test_a_description_in_the_same_package_is_a_component(tmp_path: Path) -> None:
    sub = structure(system(PLANT, before="", name="inner"))
    component = '<ssd:Component name="body" source="Body.ssd" type="application/x-ssp-definition"/>'
    ssd = structure(system(component + PI))
    model = read_package(write(tmp_path / "two.ssp", ssd, "Plant_2", "Gain_2", more={"Body.ssd": sub}))
    assert model.info.components == ("body.plant", "pi")


def test_one_input_of_the_whole_feeds_several_components(tmp_path: Path) -> None:
    second = PI.replace('name="pi"', 'name="pj"')
    port = '<ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>'
    wires = "".join(
        f'<ssd:Connection startConnector="r" endElement="{each}" endConnector="r"/>' for each in ("pi", "pj")
    )
    model = read_package(
        write(tmp_path / "fan.ssp", structure(system(PI + second, wires, before=port)), "Gain_2")
    )
    found = run(model, "pi.y", "pj.y", signals={"r": Signal((0.0, 1.0), (0.0, 1.0), "linear")})
    np.testing.assert_array_equal(found["pi.y"], found["pj.y"])
    ssd = structure(system(PI + second, wires.removesuffix("/>") + SHIFT, before=port))
    info = read_package(write(tmp_path / "fan.ssp", ssd, "Gain_2")).info
    assert info["r"].limits == (0.0, 2.0)
    assert "no value of r is within the limits of all that it feeds" in info.notes
    np.testing.assert_allclose(found["pi.y"][1:], 2.0 * np.arange(10) / 10, atol=1e-12)


def test_an_input_of_the_whole_may_have_the_values_that_all_its_targets_may(tmp_path: Path) -> None:
    echo = """<ssd:Component name="e" source="resources/Echo_2.fmu"><ssd:Connectors>
        <ssd:Connector name="in_Real" kind="input"><ssc:Real/></ssd:Connector>
        <ssd:Connector name="in_Integer" kind="input"><ssc:Integer/></ssd:Connector>
    </ssd:Connectors></ssd:Component>"""
    ports = "".join(f'<ssd:Connector name="{n}" kind="input"><ssc:Real/></ssd:Connector>' for n in "rn")
    wires = "".join(
        f'<ssd:Connection startConnector="{start}" endElement="{element}" endConnector="{end}"/>'
        for start, element, end in (
            ("r", "plant", "u"), ("r", "pi", "r"), ("n", "e", "in_Real"), ("n", "e", "in_Integer"),
        )
    )  # fmt: skip
    ports = f"<ssd:Connectors>{ports}</ssd:Connectors>"
    ssd = structure(system(PLANT + PI + echo, wires, before=ports))
    info = read_package(write(tmp_path / "i.ssp", ssd, "Plant_2", "Gain_2", "Echo_2")).info
    assert (info["r"].limits, info["n"].kind) == ((0.0, 2.0), "integer")
    ssd = ssd.replace('"in_Integer"/>', f'"in_Integer"{SHIFT}')
    with pytest.raises(SpecError, match=r"e\.in_Integer: only reals can be converted"):
        read_package(write(tmp_path / "i.ssp", ssd, "Plant_2", "Gain_2", "Echo_2"))


def test_limits_of_what_is_converted_are_round(tmp_path: Path) -> None:
    port = '<ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>'
    change = '<ssc:LinearTransformation factor="0.002" offset="0.1"/></ssd:Connection>'
    wire = f'<ssd:Connection startConnector="r" endElement="pi" endConnector="r">{change}'
    model = read_package(write(tmp_path / "l.ssp", structure(system(PI, wire, before=port)), "Gain_2"))
    assert model.info["r"].limits == (-50.0, 950.0)
    turn = altered(path("Gain_2"), tmp_path / "t", lambda x: x.replace(b'x="2.0', b'x="2.000000000000004'))
    ssd = structure(system(PI, wire.removesuffix(f">{change}") + "/>", before=port))
    file = write(tmp_path / "t.ssp", ssd, more={"resources/Gain_2.fmu": turn.read_bytes()})
    assert read_package(file).info["r"].high == 2.000000000000004, "unchanged"


@pytest.mark.parametrize(("more", "offset"), [("", 273.15), (' relativeQuantity="true"', 0.0)])
def test_offsets_do_not_move_differences(more: str, offset: float, tmp_path: Path) -> None:
    celsius = PLANT.replace('unit="m"', 'unit="degC"')
    wire = '<ssd:Connection startElement="plant" startConnector="y" endElement="pi" endConnector="measured"/>'
    out = wire.replace('endElement="pi" ', "")
    port = OUT.replace('"out"', '"measured"').replace("ssc:Real", 'ssc:Real unit="K"')
    start = BOUND.format(values("plant.x Real 300 K"))
    pi = PI.replace("Gain_2", "Gain_2kelvin").replace('unit="m"', 'unit="K"')
    ssd = structure(system(celsius + pi, wire + out, before=port + start))
    fmu = altered(
        path("Plant_2"),
        tmp_path / "p.fmu",
        lambda xml: xml.replace(b'unit="m"', f'unit="degC"{more}'.encode()),
        ending=".xml",
    )
    file = write(tmp_path / "d.ssp", ssd, "Gain_2kelvin", more={"resources/Plant_2.fmu": fmu.read_bytes()})
    found = read_package(file)
    assert [(n.factor, n.offset) for n in found.network.links] == [(1.0, offset)]
    assert dict(found.frame.values) == {"plant.x": 300.0 - offset}
    # An output that is converted would not be the component's own.
    assert ("measured" in found.info) == (offset == 0.0)


def test_outputs_of_the_whole_that_are_no_output_of_a_component_are_noted(tmp_path: Path) -> None:
    scaled = """<ssd:Connection startElement="plant" startConnector="y" endConnector="height">
      <ssc:LinearTransformation factor="2"/></ssd:Connection>"""
    ssd = structure(system(PLANT, scaled, before=ROOT_PORTS))
    model = read_package(write(tmp_path / "scaled.ssp", ssd, "Plant_2"))
    said = "the output height of the package is left out: write plant.y * 2 in formulas"
    assert said in model.info.notes and "height" not in model.info
    with pytest.raises(SpecError, match=r"'height'.* write plant"):
        parse_requirement("G (height <= 1)", model.info, Experiment(1.0, 0.1, ()))
    blank = ssd.replace('"plant"', '"big plant"').replace('r="2"', 'r="0.3333333333333333" offset="-1"')
    (note,) = (
        n for n in read_package(write(tmp_path / "b.ssp", blank, "Plant_2")).info.notes if "height" in n
    )
    value = note.partition("write ")[2].removesuffix(" in formulas")
    formula = parse_requirement(
        f"G ({value} <= 1)", read_package(tmp_path / "b.ssp").info, Experiment(1.0, 0.1, ())
    )
    assert str(formula) == 'G ("big plant.y"*0.333333333333333 - 1 <= 1)', "what is advised can be written"
    ssd = structure(system(PLANT, before=ROOT_PORTS))
    model = read_package(write(tmp_path / "open.ssp", ssd, "Plant_2"))
    assert "the output height of the package is left out: nothing feeds it" in model.info.notes


def test_each_fmu_has_its_own_units_even_if_others_mean_something_else_by_a_name(tmp_path: Path) -> None:
    gain = altered(path("Gain_2mm"), tmp_path / "g.fmu", lambda x: x.replace(b'r="0.001"', b'r="0.004"'))
    pis = "".join(PI.replace('"pi"', f'"{n}"').replace('"m"', '"mm"') for n in ("one", "two"))
    pis = pis.replace("Gain_2.fmu", "Gain_2mm.fmu", 1).replace("Gain_2.fmu", "other.fmu")
    wires = "".join(FEEDBACK.split("/>", 1)[1].replace('"pi"', f'"{n}"') for n in ("one", "two"))
    more: dict[str, str | bytes] = {"resources/other.fmu": gain.read_bytes()}
    file = write(tmp_path / "u.ssp", structure(system(PLANT + pis, wires)), "Plant_2", "Gain_2mm", more=more)
    factors = [link.factor for link in read_package(file).network.links]
    assert factors == pytest.approx([1000.0, 250.0])


def plant(old: str, new: str) -> str:
    """A structure with the plant alone, in which something is replaced."""
    return structure(system(PLANT.replace(old, new)))


def feedback(old: str, new: str, *, pi: str = PI) -> str:
    """A structure of both, in whose connections something is replaced."""
    return structure(system(PLANT + pi, FEEDBACK.replace(old, new)))


BOUND = "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{}</ssd:ParameterValues>"
BOUND += "</ssd:ParameterBinding></ssd:ParameterBindings>"


def given(value: str) -> str:
    """A structure with the plant alone, for which the whole gives a value."""
    return structure(system(PLANT, before=BOUND.format(values(value))))


FLAT = """<ssd:Connection startConnector="a" endElement="plant" endConnector="u">
<ssc:LinearTransformation factor="0"/></ssd:Connection>"""
MAPPED = FEEDBACK.replace('"u"/>', '"u"><ssc:IntegerMappingTransformation/></ssd:Connection>')
ITSELF = '<ssd:Component name="me" source="SystemStructure.ssd" type="application/x-ssp-definition"/>'
DEEP = '<ssd:System name="a"><ssd:Elements>' * 1500 + "</ssd:Elements></ssd:System>" * 1500
BUS = '<ssd:SignalDictionaryReference name="bus" dictionary="d"/>'
INNER = f'<ssd:System name="inner"><ssd:Elements>{PI}</ssd:Elements></ssd:System>'
# Only an element's own system may connect it.
FROM_INNER = FEEDBACK.replace('"pi"', '"inner.pi"')
IN_KELVIN = PI.replace("Gain_2", "Gain_2kelvin").replace(' unit="m"', "")
SCHEDULED, EXCHANGED = (f'<ssd:Component implementation="{each}" ' for each in ("Scheduled", "ModelExchange"))
OUT = '<ssd:Connectors><ssd:Connector name="out" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>'
FED_BY_NOTHING = FEEDBACK.replace('"pi" startConnector="y"', '"box" startConnector="out"')
WRONG = {
    "not well-formed XML": "<ssd",
    "expected the SSP element SystemStructureDescription, got a": "<a/>",
    "SSP version '3.0'; export it as SSP 1.0 or 2.0": structure(system(PLANT), version="3.0"),
    "it has no System": structure(""),
    "the element plant: the resource 'resources/Gone.fmu' is missing": plant("Plant_2", "Gone"),
    "the element plant: '../Plant_2.fmu' is not inside the package": plant("resources/", "../"),
    "the element plant: 'file:///Plant_2.fmu' is not inside the package": plant("resources/", "file:///"),
    "the element plant: 'http://[Plant_2.fmu' is not a path": plant("resources/", "http://["),
    "the component plant: resources/Broken.fmu: ": plant("Plant_2", "Broken"),
    "two elements are named 'plant'": structure(system(PLANT + PLANT)),
    "has the name '' and the source": plant('"plant"', '""'),
    "neither may be empty": plant("resources/Plant_2.fmu", ""),
    "the connection a - plant.u: a LinearTransformation has the factor 0": structure(system(PLANT, FLAT)),
    "the connection a - plant.u: factor: 'ten' is not a finite number": structure(
        system(PLANT, FLAT.replace('"0"', '"ten"'))
    ),
    "the element box: the connection b.y - plant.u names the unknown element 'b'": structure(
        system(system(PLANT, FEEDBACK.replace('"pi"', '"b"'), name="box"))
    ),
    "DefaultExperiment: stopTime: 'late' is not a": structure(
        system(PLANT), after='<ssd:DefaultExperiment stopTime="late"/>'
    ),
    "SystemStructure.ssd: Unit 'mm': factor = 'small': expected a number": structure(
        system(PLANT), after=MILLIMETRE.replace("0.001", "small")
    ),
    "SystemStructure.ssd: Unit '': name is missing": structure(
        system(PLANT), after=MILLIMETRE.replace('name="mm"', "")
    ),
    "nested more than 400 deep": structure(DEEP),
    "the FMU of plant has no variable for the connector plant.v; ": plant('"u"', '"v"'),
    "plant.u is of kind output, the FMU's variable of kind input": plant('kind="input"', 'kind="output"'),
    "plant.u is of type Boolean, the FMU's variable of type Real": plant('Real unit="m"', "Boolean"),
    "the connector plant.u is in kg, the FMU's variable in m": plant('unit="m"', 'unit="kg"'),
    "names the unknown connector 'plant.v'; known: u, y, T": feedback('Connector="u"', 'Connector="v"'),
    "names the unknown element 'po'; did you mean 'pi'": feedback('startElement="pi"', 'startElement="po"'),
    "names the unknown element 'inner.pi'": structure(system(PLANT + INNER, FROM_INNER)),
    "the connection pi.y - plant.y joins two outputs": feedback('Connector="measured"', 'Connector="y"'),
    "plant.u is fed by the output box.out, which nothing feeds": structure(
        system(PLANT + PI + system("", before=OUT, name="box"), FED_BY_NOTHING)
    ),
    "the element plant: <Connector kind=\"input\">: the attribute 'name' is missing": plant(
        'name="u" kind', "kind"
    ),
    "the system: the parameter plant.T: value: 'much' is not a finite number": given("plant.T Real much"),
    "the element plant: the parameter T: value: 'nan' is not a finite number": plant(
        "<ssd:Connectors>", BOUND.format(values("T Real nan")) + "<ssd:Connectors>"
    ),
    "the connection pi.y - plant.T feeds a parameter": feedback('Connector="u"', 'Connector="T"'),
    "the parameter plant.T: 'maybe': expected true or false": given("plant.T Boolean maybe"),
    "plant.T is -5: exceeds the model's limits for 'plant.T', [0.1, no limit]": given("plant.T Real -5"),
    "plant.u is fed by pi.y and by pi.y": structure(system(PLANT + PI, FEEDBACK + FEEDBACK)),
    "plant.y is in m, pi.measured in K; the package defines no": feedback("", "", pi=IN_KELVIN),
    "plant: it is of type application/x-m; only FMUs": plant(" source", ' type="application/x-m" source'),
    "the system contains itself, at me": structure(system(ITSELF)),
    "the parameter plant.y cannot be set": given("plant.y Real 1"),
    "'bus' refers to a signal dictionary, which is not supported": structure(system(BUS)),
    "pi.y - plant.u: the element IntegerMappingTransformation is not supported": structure(
        system(PLANT + PI, MAPPED)
    ),
    "the element plant: its implementation is 'Scheduled'; expected one of any, Co": plant(
        "<ssd:Component ", SCHEDULED
    ),
    "the FMU offers co-simulation, not model-exchange": plant("<ssd:Component ", EXCHANGED),
}


@pytest.mark.parametrize("message", WRONG)
def test_a_wrong_package_is_one_clear_line(message: str, tmp_path: Path) -> None:
    fmus = ("Plant_2", "Gain_2", "Gain_2kelvin")
    file = write(tmp_path / "wrong.ssp", WRONG[message], *fmus, more={"resources/Broken.fmu": b"no zip"})
    with pytest.raises(Exception, match="wrong") as wrong:
        read_package(file)
    assert message in str(wrong.value) and "\n" not in str(wrong.value)
    assert str(wrong.value).startswith(str(file))
    assert getattr(wrong.value, "exit_code", None) == 2


def test_an_fmu_with_wrong_units_is_a_wrong_package(tmp_path: Path) -> None:
    known, wrong = b'<BaseUnit m="1"/>', b'<BaseUnit m="one"/>'
    odd = altered(path("Plant_2"), tmp_path / "Odd.fmu", lambda content: content.replace(known, wrong))
    more: dict[str, str | bytes] = {"resources/Odd.fmu": odd.read_bytes()}
    file = write(tmp_path / "odd.ssp", plant("Plant_2", "Odd"), more=more)
    with pytest.raises(
        SpecError, match=r"odd\.ssp: the component plant: resources/Odd\.fmu: .*units or dependencies"
    ):
        read_package(file)


def test_packages_that_grow_like_powers_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ssp, "_MAX_ELEMENTS", 100)

    def twice(name: str) -> str:
        each = '<ssd:Component name="{}" source="{}.ssd" type="application/x-ssp-definition"/>'
        return structure(system(each.format("a", name) + each.format("b", name)))

    more: dict[str, str | bytes] = {f"d{k}.ssd": twice(f"d{k + 1}") for k in range(40)}
    file = write(tmp_path / "powers.ssp", twice("d0"), more={**more, "d40.ssd": structure(system(""))})
    with pytest.raises(Exception, match=r"powers\.ssp: the system has more than 100 elements"):
        read_package(file)


@pytest.mark.parametrize("times", ['stopTime="-1"', 'stopTime="0"', 'startTime="5" stopTime="2"'])
def test_a_default_experiment_that_ends_before_it_starts_is_refused(tmp_path: Path, times: str) -> None:
    ssd = structure(system(PLANT + PI, FEEDBACK), after=f"<ssd:DefaultExperiment {times}/>")
    with pytest.raises(SpecError, match=r"DefaultExperiment: the stop time -?\d s must be after the start"):
        read_package(write(tmp_path / "loop.ssp", ssd, "Plant_2", "Gain_2"))


@pytest.mark.parametrize("name", ["gone.ssp", "gone.ssd"])
def test_what_is_not_there_is_said(name: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"gone\.ss.: no such file; give the path of an \.ssp or \.ssd file"):
        read_package(tmp_path / name)


def test_what_is_no_archive_or_has_no_description_is_said(tmp_path: Path) -> None:
    file = tmp_path / "a.ssp"
    file.write_bytes(b"no zip")
    with pytest.raises(SpecError, match=r"a\.ssp: not a readable SSP package, which is a zip archive"):
        read_package(file)
    packed(file, {"readme.txt": ""})
    with pytest.raises(SpecError, match=r"a\.ssp: the package contains no SystemStructure\.ssd"):
        read_package(file)


def test_a_name_that_is_too_long_is_missing(tmp_path: Path) -> None:
    (tmp_path / "a.ssd").write_text(structure(system(PLANT.replace("resources/", "x" * 300))))
    with pytest.raises(
        SpecError, match=r"/a\.ssd: the element plant: the resource 'x+Plant_2\.fmu' is missing"
    ):
        read_package(tmp_path / "a.ssd")
