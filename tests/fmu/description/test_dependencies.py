from pathlib import Path
from zipfile import ZipFile

import pytest

from falsifier.core.files import bundled
from falsifier.errors import ModelError
from falsifier.fmu.description.archive import file_hash
from falsifier.fmu.description.dependencies import inputs_of_outputs

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


def written(folder: Path, description: str) -> tuple[Path, str]:
    path = folder / "a.fmu"
    with ZipFile(path, "w") as fmu:
        fmu.writestr("modelDescription.xml", description)
    return path, file_hash(path)


def test_inputs_reach_outputs_through_states(tmp_path: Path) -> None:
    text = FMI2.format(derivative='dependencies="1 3"')
    assert inputs_of_outputs(*written(tmp_path, text)) == {"y": {"u"}, "z": frozenset()}
    assert inputs_of_outputs(*written(tmp_path, FMI3)) == {"y": {"u"}}


def test_a_state_that_says_nothing_may_depend_on_all(tmp_path: Path) -> None:
    assert inputs_of_outputs(*written(tmp_path, FMI2.format(derivative=""))) == {"z": frozenset()}


def test_fmus_that_declare_nothing_have_no_entries() -> None:
    path = bundled("fmus") / "AT.fmu"
    assert inputs_of_outputs(path, file_hash(path)) == {}


def test_damage_is_named(tmp_path: Path) -> None:
    text = FMI2.format(derivative="").replace('index="4"', 'index="40"')
    with pytest.raises(ModelError, match="dependencies in modelDescription"):
        inputs_of_outputs(*written(tmp_path, text))
