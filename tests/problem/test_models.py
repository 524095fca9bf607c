import re
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.core.model import Interface, ModelInfo
from falsifier.errors import SpecError
from falsifier.fmu import Coupling, FmuModel, System
from falsifier.problem.loading import load_problem
from tests.fmu.fixtures import path

COMPONENTS = f"""
[components.plant]
fmu = "{path("Plant_2")}"
[components.pi]
fmu = "{path("Gain_2")}"
"""
CONNECTIONS = """
[connections]
"plant.u" = "pi.y"
"pi.measured" = "plant.y"
"""
REST = """
[inputs."pi.r"]
control_points = 3
[parameters]
"plant.T" = 1.0
"pi.k".range = [1.0, 2.0]
[requirements.R]
formula = "G[0,10] (plant.y <= 0.8)"
"""


def write(folder: Path, text: str) -> str:
    file = folder / "cruise.toml"
    file.write_text(text)
    return str(file)


def test_a_spec_of_components_is_a_problem_like_any_other(tmp_path: Path) -> None:
    problem = load_problem(write(tmp_path, COMPONENTS + CONNECTIONS + REST))
    assert isinstance(problem.model, System) and problem.info.name == "cruise"
    assert problem.space.names == ("pi.r", "pi.k")
    assert (problem.space.inputs[0].low, problem.space.inputs[0].high) == (0.0, 2.0), "the FMU's own limits"
    assert problem.parameters == {"plant.T": 1.0}
    assert problem.experiment.outputs == ("plant.y", "pi.y")
    assert problem.notes[0].startswith("components step in the order plant, pi")


def test_coupling_and_conversions_reach_the_system(tmp_path: Path) -> None:
    text = (
        COMPONENTS.replace('Gain_2.fmu"', 'Gain_2kelvin.fmu"\nstep = 0.1')
        + """
[connections]
"plant.u" = "pi.y"
"pi.measured" = { from = "plant.y", factor = 2.0, offset = 1.0, extrapolation = "linear" }
[coupling]
method = "jacobi"
loops = "delay"
isolation = "each"
"""
    )
    model = load_problem(write(tmp_path, text + REST)).model
    assert isinstance(model, System)
    assert model.coupling == Coupling("jacobi", "delay", isolation="each")
    link = model.network.links[1]
    assert (link.factor, link.offset, link.is_linear) == (2.0, 1.0, True)
    assert model.parts["pi"].step == 0.1


WRONG = [
    (COMPONENTS + '[model]\nfmu = "a.fmu"\n' + REST, "model.fmu: a spec has one FMU here or"),
    ('[model]\nfmu = "a.fmu"\n' + CONNECTIONS + REST, "connections: only a system has this section"),
    (REST, "model.fmu: this key is missing: Path of the FMU"),
    (COMPONENTS.replace("Gain_2", "Gone_2") + REST, "components.pi.fmu: "),
    (COMPONENTS + CONNECTIONS.replace("pi.y", "pi.z") + REST, "pi.z -> plant.u: pi has no output 'z'"),
    (COMPONENTS + "[connections]\nplant.u = 'pi.y'\n" + REST, 'written in quotes: "plant.u" = ...'),
    (COMPONENTS + REST.replace('"pi.r"', "pi.r"), 'written in quotes: [inputs."pi.r"]'),
    (COMPONENTS + REST.replace('"plant.T"', "plant.T"), 'written in quotes: "plant.T" = ...'),
    (
        COMPONENTS + CONNECTIONS + REST.replace('"pi.r"', '"plant.u"'),
        "inputs.plant.u: this input is connected to pi.y; leave it out, or remove the connection",
    ),
    (COMPONENTS + CONNECTIONS + REST.replace('"plant.T"', '"plant.u"'), "parameters.plant.u: this input"),
    (COMPONENTS + REST.replace('"pi.r"', '"pi.x"'), "inputs.pi.x: the system has no such input; did you"),
    (COMPONENTS + '[model]\ninterface = "model-exchange"\n' + REST, "set components.NAME.interface"),
    (COMPONENTS + "step = 0.03\n[model]\noutput_interval = 0.02\n" + REST, "try output_interval = 0.01"),
    (COMPONENTS + "step = 100\n" + REST, "components.pi.step: 100 s is longer than the simulation"),
    (COMPONENTS.replace("Gain_2.fmu", "inner.ssp") + REST, "an SSP package cannot be a component"),
    (COMPONENTS.replace("[components.pi]", "[components.'']") + REST, "the name of a component is empty"),
    (COMPONENTS + "[coupling]\nmax_rounds = 1\n" + REST, "coupling.max_rounds: "),
    (COMPONENTS + '[coupling]\nmetod = "jacobi"\n' + REST, "coupling.metod: unknown key; did you mean 'm"),
]


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_wrong_specs_name_the_file_the_key_and_the_cure(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=re.escape(message)) as wrong:
        load_problem(write(tmp_path, text))
    assert str(wrong.value).startswith(f"{tmp_path}/cruise.toml: ")


RIGHTS = f"""
[model]
fmu = "{path("Plant_2")}"
stop_time = 10.0
allow = ["write:logs"]
[inputs.u]
range = [0.0, 1.0]
control_points = 3
[requirements.R]
formula = "G[0,10] (y <= 0.8)"
deny = ["network"]
"""


def test_what_an_fmu_may_do_comes_from_spec_requirement_and_options(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    problem = load_problem(write(tmp_path, RIGHTS), allow=["programs"])
    assert isinstance(problem.model, FmuModel)
    assert problem.model.allow == (f"write:{tmp_path / 'logs'}", "programs")
    assert problem.model.deny == ("network",)
    assert any("may also: write:" in note and "programs" in note for note in problem.notes)


@pytest.mark.parametrize(
    ("allow", "deny", "message"),
    [
        ("write:absent", "", "absent: there is no such file or folder; create it first"),
        ("write:~no-such-user/x", "", "~no-such-user/x: there is no such file or folder; create it first"),
        ("reading", "", "unknown 'reading'.*write:PATH, read:PATH, programs"),
        ("", "files", "unknown 'files'.*network"),
    ],
)
def test_rights_that_do_not_exist_are_named(tmp_path: Path, allow: str, deny: str, message: str) -> None:
    (tmp_path / "logs").mkdir()
    file = write(tmp_path, RIGHTS)
    with pytest.raises(SpecError, match=f"^(allow|deny).*{message}"):
        load_problem(file, allow=[allow] if allow else [], deny=[deny] if deny else [])
    right, wrong = ("write:logs", allow) if allow else ("network", deny)
    with pytest.raises(SpecError, match=rf"cruise.toml: (model\.allow|requirements\.R\.deny): .*{message}"):
        load_problem(write(tmp_path, RIGHTS.replace(f'"{right}"', f'"{wrong}"')))


INFO = ModelInfo("m")


@pytest.mark.parametrize(
    ("offered", "chosen"),
    [(("model-exchange", "co-simulation"), "co-simulation"), (("model-exchange",), "model-exchange")],
)
def test_co_simulation_goes_first(offered: tuple[Interface, ...], chosen: str) -> None:
    assert replace(INFO, interfaces=offered).default_interface == chosen
