from pathlib import Path
from xml.etree import ElementTree

import pytest

from falsifier.core.files import bundled
from falsifier.errors import ModelFileError
from falsifier.fmu.description import archive
from falsifier.fmu.description.structure import Structure, conversion, read_structure, read_units
from tests.fixtures.archives import packed
from tests.fmu.fixtures import path

FMI2 = """<fmiModelDescription fmiVersion="2.0"><ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real/></ScalarVariable>
<ScalarVariable name="v" valueReference="1" causality="input"><Real/></ScalarVariable>
<ScalarVariable name="x" valueReference="2"><Real/></ScalarVariable>
<ScalarVariable name="dx" valueReference="3"><Real derivative="3"/></ScalarVariable>
<ScalarVariable name="y" valueReference="4" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="z" valueReference="5" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="all" valueReference="6" causality="output"><Real/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs>
<Unknown index="5" dependencies="3"/><Unknown index="6" dependencies=""/><Unknown index="7"/>
</Outputs>
<Derivatives><Unknown index="4" {derivative}/></Derivatives></ModelStructure></fmiModelDescription>"""
FMI3 = """<fmiModelDescription fmiVersion="3.0"><ModelVariables>
<Float64 name="u" valueReference="10" causality="input"/><Float64 name="x" valueReference="11"/>
<Float64 name="dx" valueReference="12" derivative="11"/>
<Float64 name="y" valueReference="13" causality="output"/>
</ModelVariables><ModelStructure><Output valueReference="13" dependencies="11"/>
<ContinuousStateDerivative valueReference="12" dependencies="10 11"/></ModelStructure>
</fmiModelDescription>"""


def structure(file: Path) -> Structure:
    return read_structure(file, archive.file_hash(file))


@pytest.mark.parametrize("major", [2, 3])
def test_outputs_depend_on_the_inputs_that_the_fmu_lists(major: int) -> None:
    assert structure(path(f"Gain_{major}")).inputs_of == {"y": {"r", "measured"}}
    assert structure(path(f"Plant_{major}")).inputs_of == {"y": frozenset()}
    assert structure(path(f"Lag_{major}")).inputs_of == {}, "it does not say a word about its output"


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ('index="3" dependencies="1 2"', 'index="99" dependencies="1"', "there is no '99'"),
        ('index="3" dependencies="1 2"', 'index="3" dependencies="99"', "there is no '99'"),
        ('BaseUnit m="1"', 'BaseUnit m="one"', "Unit 'm': m = 'one': expected a whole number"),
    ],
)
def test_wrong_references_and_units_are_one_clear_error(
    right: str, wrong: str, said: str, tmp_path: Path
) -> None:
    text = archive.read_entry(path("Gain_2"), "modelDescription.xml").decode()
    file = written(tmp_path, text.replace(right, wrong))
    expected = rf"a\.fmu: units or dependencies .* do not follow the standard \({said}\)"
    with pytest.raises(ModelFileError, match=expected):
        structure(file)


def written(folder: Path, description: str) -> Path:
    return packed(folder / "a.fmu", {"modelDescription.xml": description})


def test_inputs_reach_outputs_through_states(tmp_path: Path) -> None:
    text = FMI2.format(derivative='dependencies="1 3"')
    assert structure(written(tmp_path, text)).reaching == {"y": {"u"}, "z": frozenset()}
    assert structure(written(tmp_path, FMI3)).reaching == {"y": {"u"}}
    silent = structure(written(tmp_path, FMI2.format(derivative="")))
    assert silent.reaching == {"z": frozenset()}, "a state that says nothing may depend on all"
    assert structure(bundled("fmus") / "AT.fmu").reaching == {}, "nothing is declared"


UNITS = """<x><UnitDefinitions>
  <Unit name="furlong"><BaseUnit m="1" factor="201.168"/></Unit>
  <Unit name="degX"><BaseUnit K="1" factor="2" offset="100"/></Unit>
  <Unit name="bogus"/>
</UnitDefinitions></x>"""


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [
        ("m", "m", 3.0, 3.0),
        ("furlong", "m", 1.0, 201.168),
        ("m", "furlong", 402.336, 2.0),
        ("degX", "K", 10.0, 120.0),
        ("K", "degX", 120.0, 10.0),
        ("degX", "degC", 10.0, -153.15),
        ("km/h", "m/s", 36.0, 10.0),
        ("", "m", 3.0, 3.0),
        ("m", "", 3.0, 3.0),
        ("bogus", "bogus", 3.0, 3.0),
    ],
)
@pytest.mark.parametrize("definer", [0, 1])
def test_values_are_converted_whichever_fmu_defines_the_unit(
    source: str, target: str, value: float, expected: float, definer: int
) -> None:
    known = read_units(ElementTree.fromstring(UNITS))
    found = conversion(source, target, (known, {}) if definer == 0 else ({}, known))
    assert found is not None
    assert found[0] * value + found[1] == pytest.approx(expected)


@pytest.mark.parametrize(("source", "target"), [("m", "s"), ("bogus", "m"), ("m", "bogus"), ("V", "N")])
def test_what_cannot_be_converted_is_not(source: str, target: str) -> None:
    assert conversion(source, target, ({}, {})) is None
