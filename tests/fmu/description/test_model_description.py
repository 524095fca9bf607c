from typing import Any
from xml.etree import ElementTree

import pytest

from falsifier.errors import ModelError, SpecError
from falsifier.fmu import read_info
from falsifier.fmu.description.model_description import Description, parse, read_description
from falsifier.problem.ranges import search_space
from falsifier.problem.shorthand import changes_from
from tests.fmu import fixtures

ALL = sorted(p.stem for p in fixtures.FOLDER.glob("*.fmu"))


def described(text: str) -> Description:
    return parse(ElementTree.fromstring(text), name="test.fmu")


@pytest.mark.parametrize("name", [n for n in ALL if n not in ("Scheduled_3", "Clocked_3")])
def test_agrees_with_fmpy(name: str) -> None:
    from fmpy import read_model_description

    path = fixtures.path(name)
    expected: Any = read_model_description(str(path), validate=True)
    description = read_description(path)
    info = description.info
    assert (info.name, info.fmi_version) == (expected.modelName, expected.fmiVersion)
    assert description.token == expected.guid
    default = expected.defaultExperiment
    assert info.stop_time == float(default.stopTime)
    assert info.step_size == (None if default.stepSize is None else float(default.stepSize))
    assert info.tolerance == (None if default.tolerance is None else float(default.tolerance))
    assert ("co-simulation" in info.interfaces) == (expected.coSimulation is not None)
    assert ("model-exchange" in info.interfaces) == (expected.modelExchange is not None)
    scalars = {v.name: v for v in expected.modelVariables if not v.dimensions}
    for variable in info.variables:
        if variable.name not in scalars:
            continue
        twin = scalars[variable.name]
        assert description.slots[variable.name].reference == twin.valueReference
        assert variable.unit == ("" if twin.unit == "1" else twin.unit or "")
        assert variable.description == (twin.description or "")
        assert variable.display_unit == (twin.displayUnit or "")
        assert variable.nominal == (None if twin.nominal is None else float(twin.nominal))
        # Limits that stand for "none" in some exporters are none here.
        low = None if twin.min is None else float(twin.min)
        assert variable.low == (low if low is None or abs(low) < 1e30 else None)
        if variable.kind == "string":
            assert variable.start == twin.start
        elif twin.start is not None and variable.kind != "boolean":
            assert variable.start == float(twin.start)
        if variable.causality in ("input", "output"):
            assert variable.causality == twin.causality


@pytest.mark.parametrize("name", ["Echo_1", "Echo_2", "Echo_3"])
def test_enumerations_tell_their_literals(name: str) -> None:
    info = read_info(fixtures.path(name))
    assert info["in_Enumeration"].literals == {"first": 1, "second": 2, "third": 3}
    assert info["in_Enumeration"].kind == "enumeration"


DERIVATIVE = '<Derivatives><Unknown index="9"/></Derivatives>'
SIZED = """<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="g">
<CoSimulation modelIdentifier="M"/><ModelVariables>
<Float64 name="x" valueReference="1"><Dimension {}/></Float64></ModelVariables>
<ModelStructure/></fmiModelDescription>"""
ROLES = """
<fmiModelDescription fmiVersion="2.0" modelName="M" guid="g"><CoSimulation modelIdentifier="M"/>
<ModelVariables>
<ScalarVariable name="c" valueReference="0" variability="constant"><Real start="1"/></ScalarVariable>
<ScalarVariable name="k" valueReference="1" causality="calculatedParameter"><Real/></ScalarVariable>
<ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="t" valueReference="3" causality="independent"><Real/></ScalarVariable>
<ScalarVariable name="s" valueReference="4" causality="parameter"><String start="a"/></ScalarVariable>
<ScalarVariable name="p" valueReference="5" causality="parameter"><Real start="1"/></ScalarVariable>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


def test_what_cannot_be_set_says_why() -> None:
    info = described(ROLES).info
    assert "constant" in info["c"].refusal
    assert "calculated parameter" in info["k"].refusal
    assert "computes its initial value" in info["y"].refusal
    assert "time" in info["t"].refusal
    assert info["p"].refusal == ""
    lag = read_info(fixtures.path("Lag_2"))
    assert [v.name for v in lag.variables if v.is_state] == ["x"]
    assert [v.name for v in lag.variables if v.settable] == ["u", "x", "T", "gain"]


def test_array_sizes_from_structural_parameters_and_aliases() -> None:
    description = described(
        """<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="g">
        <CoSimulation modelIdentifier="M" fixedInternalStepSize="0.25"/><ModelVariables>
        <UInt64 name="n" valueReference="0" causality="structuralParameter" variability="fixed" start="3"/>
        <Float64 name="x" valueReference="1" causality="output" initial="exact" start="7">
          <Dimension valueReference="0"/><Alias name="state"/></Float64>
        <Int64 name="i" valueReference="2" causality="input" start="9223372036854775807"/>
        </ModelVariables><ModelStructure/></fmiModelDescription>"""
    )
    names = [v.name for v in description.info.variables]
    assert names == ["n", "x[1]", "x[2]", "x[3]", "state[1]", "state[2]", "state[3]", "i"]
    assert description.slots["state[2]"].reference == 1
    assert description.arrays[1] == (7.0, 7.0, 7.0)
    changes = changes_from(parameters={"n": (1, 5)})
    with pytest.raises(SpecError, match="structural parameter; arrays have the sizes of its start value"):
        search_space({}, changes.parameters, description.info, 1.0, changes)
    assert description.info.internal_step == 0.25 and not description.info.notes


def test_start_values_and_items_that_cannot_all_be_used_are_noted() -> None:
    text = """<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="g">
        <CoSimulation modelIdentifier="M"/><TypeDefinitions><EnumerationType name="E">
        <Item name="a" value="3"/><Item name="b" value="-7"/><Item name="b" value="100"/>
        </EnumerationType></TypeDefinitions><ModelVariables>
        <Float64 name="x" valueReference="1" causality="parameter" variability="fixed" start="7 8 9">
          <Dimension start="2"/></Float64>
        <Enumeration name="e" valueReference="2" causality="input" declaredType="E" start="5"/>
        <Int8 name="i" valueReference="3" causality="input" start="300"/>
        </ModelVariables><ModelStructure/></fmiModelDescription>"""
    description = described(text)
    assert description.arrays[1] == (7.0, 8.0)
    assert description.info.notes == (
        "the description contradicts itself: an enumeration has 2 items named 'b', of which the last counts, "
        "'x' has 3 start values for 2 elements, so the last ones are ignored, "
        "start = 5: expected one of 3 = a, 100 = b for 'e', "
        "start = 300 exceeds the range of the type Int8 of 'i', [-128, 127]",
    )
    with pytest.raises(ModelError, match="'x': start has 3 values for 4 elements"):
        described(text.replace('Dimension start="2"', 'Dimension start="4"'))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<fmiModelDescription fmiVersion="4.0"/>', "fmiVersion is '4.0'; export it as FMI"),
        ('<fmiModelDescription fmiVersion="2.0"/>', "does not follow FMI 2.0: modelName is missing"),
        (ROLES.replace(' modelIdentifier="M"', ""), "does not follow FMI 2.0: modelIdentifier is missing"),
        (ROLES.replace('Identifier="M"', 'Identifier="../../M"'), r"= '\.\./\.\./M': .* without a folder"),
        (ROLES.replace(' valueReference="5"', ""), "ScalarVariable 'p': valueReference is missing"),
        (
            ROLES.replace('"5"', '"six"'),
            "ScalarVariable 'p': valueReference = 'six': expected a whole number",
        ),
        (ROLES.replace('start="1"/></S', 'start="0,0"/></S'), "'c': start = '0,0': expected a number"),
        (ROLES.replace('"output"', '"outptu"'), "'y': causality = 'outptu': did you mean 'output'"),
        (ROLES.replace('name="y"', 'name=""'), "a variable has an empty name"),
        (
            ROLES.replace("<ModelStructure/>", f"<ModelStructure>{DERIVATIVE}</ModelStructure>"),
            "ModelStructure: index = 9: there are 6 variables",
        ),
        (
            ROLES.replace("<ModelStructure/>", f"<ModelStructure>{DERIVATIVE}</ModelStructure>").replace(
                '"9"', '"0"'
            ),
            "ModelStructure: index = 0: there are 6 variables",
        ),
        (SIZED.format('start="two"'), "'x': start = 'two': expected a whole number"),
        (SIZED.format('valueReference="two"'), "'x': valueReference = 'two': expected a whole number"),
    ],
)
def test_wrong_descriptions_are_named(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=rf"test\.fmu: .*{message}"):
        described(text)


def test_times_of_the_default_experiment_that_no_simulation_can_use_are_named() -> None:
    times = '<DefaultExperiment startTime="0" stopTime="-1" stepSize="0" tolerance="1e-6"/><ModelVariables>'
    (said,) = described(ROLES.replace("<ModelVariables>", times)).info.notes
    assert said == "ignored in the default experiment, as not greater than 0: stopTime = -1, stepSize = 0"


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ('min="2" max="1" start="1.5"', "min = 2 of 'p' is greater than max = 1, so both are ignored"),
        ('start="NaN"', "start of 'p' is nan"),
        ('min="0" max="1" start="5"', "start = 5 exceeds the model's limits for 'p', [0, 1]"),
        ('min="0" max="1" start="1"', ""),
    ],
)
def test_limits_and_start_values_that_cannot_be_meant_are_noted(attributes: str, said: str) -> None:
    variable = f"""<ScalarVariable name="p" valueReference="7" causality="parameter" variability="fixed">
        <Real {attributes}/></ScalarVariable>"""
    text = ROLES.replace('"p"', '"q"').replace("<ModelVariables>", f"<ModelVariables>{variable}")
    expected = (f"the description contradicts itself: {said}",) if said else ()
    info = described(text).info
    assert info.notes == expected
    low, high = info["p"].limits
    assert low is None or high is None or low < high
