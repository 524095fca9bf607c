"""A system of FMUs is searched, recorded, resumed and replayed as one FMU is."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from falsifier import Problem, System, confirm, evaluate, falsify, load_problem, resume
from falsifier.cli import cli
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.store import load_counterexample, replay
from falsifier.errors import JournalError, SpecError
from tests.command import falsifier
from tests.fmu.fixtures import path
from tests.fmu.packages import FEEDBACK, PI, PLANT, structure, system, write
from tests.fmu.small_systems import loop

SPEC = """
[components.plant]
fmu = "Plant_2.fmu"
[components.pi]
fmu = "Gain_2.fmu"
[connections]
"plant.u" = "pi.y"
"pi.measured" = "plant.y"
[model]
output_interval = 0.1
[inputs."pi.r"]
control_points = 3
[requirements.R]
formula = "G[0,10] (plant.y <= 1.2)"
"""


@pytest.fixture
def spec(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)  # the record names the spec as the command line did
    for name in ("Plant_2", "Gain_2"):
        (tmp_path / f"{name}.fmu").write_bytes(path(name).read_bytes())
    file = tmp_path / "loop.toml"
    file.write_text(SPEC)
    return file


def test_from_a_spec_to_the_counterexample_and_back(spec: Path, tmp_path: Path) -> None:
    problem = load_problem("loop.toml")
    assert "plant.u uses the values of the previous communication point" in problem.notes[0]
    assert falsify(problem, engine="corners", budget=5, directory=tmp_path / "run").falsified
    assert "half the communication step (0.05 s)" in load_counterexample(tmp_path / "run").reason
    hashes = json.loads((tmp_path / "run" / "manifest.json").read_text())["hashes"]
    assert sorted(Path(p).name for p in hashes) == ["Gain_2.fmu", "Plant_2.fmu", "loop.toml"]
    (again,) = resume(tmp_path / "run")
    assert again.falsified and again.spent.simulations == 1

    stored = load_counterexample(tmp_path / "run")
    replayed = replay(stored, problem)
    assert replayed.status == "violates" and replayed.text.startswith("R: still violated")
    evaluation = replayed.evaluation
    assert evaluation is not None
    files = export_counterexample(problem, stored, evaluation, tmp_path / "exported")
    assert "loop.ssp" in [file.name for file in files]
    exported = load_problem(str(tmp_path / "exported" / "loop.ssp"), stl=stored.formula, output_interval=0.1)
    assert evaluate(exported, evaluation.candidate).robustness == stored.robustness
    spec.write_text(SPEC.replace('"pi.measured" = "plant.y"\n', ""))
    with pytest.raises(JournalError, match="has changed since the start"):
        resume(tmp_path / "run")
    spec.write_text(SPEC)
    (tmp_path / "Gain_2.fmu").write_bytes(path("Gain_3").read_bytes())
    assert "an FMU of the system has changed" in replay(stored, load_problem("loop.toml")).text
    with pytest.raises(JournalError, match=r"Gain_2\.fmu has changed since the start"):
        resume(tmp_path / "run")
    (tmp_path / "Gain_2.fmu").write_bytes(path("Echo_2").read_bytes())  # what the spec connects is missing
    with pytest.raises(JournalError, match=r"Gain_2\.fmu has changed since the start"):
        resume(tmp_path / "run")


def test_a_command_that_needs_one_fmu_names_those_of_the_system(spec: Path, tmp_path: Path) -> None:
    refused = CliRunner().invoke(cli, ["tools", "build", "loop.toml"])
    assert refused.exit_code == 2 or isinstance(refused.exception, SpecError)
    assert "give one of them: plant, pi" in str(refused.exception) + refused.output


def test_a_problem_made_in_python_is_searched() -> None:
    problem = Problem.from_fmu(
        loop(), "G[0,10] (plant.y <= 1.2)", inputs={"pi.r": (0.0, 2.0, 3)}, output_interval=0.1
    )
    assert falsify(problem, engine="corners", budget=3).falsified
    everything = Problem.from_fmu(loop(), "G[0,10] (plant.y <= 1.2)")
    assert everything.space.names == ("pi.r",), "inputs with limits that nothing feeds"


def test_what_only_the_coupling_violates_is_fragile() -> None:
    """With a gain of 30 the loop oscillates at a step of 0.1 s, and does not at half of it."""
    problem = Problem.from_fmu(
        loop(), "G[0,5] (plant.y <= 1.3)", parameters={"pi.k": 30.0}, inputs={"pi.r": (0.0, 1.0, 1)},
        stop_time=5.0, output_interval=0.1,
    )  # fmt: skip
    found = evaluate(problem, Candidate({"pi.r": Signal((0.0,), (1.0,))}, {}, "test"))
    assert found.violated
    confirmation = confirm(problem, found)
    assert confirmation.outcome == "fragile"
    assert "half the communication step (0.05 s)" in confirmation.reason


def test_a_package_is_a_model_wherever_an_fmu_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ssd = structure(system(PLANT + PI, FEEDBACK), after='<ssd:DefaultExperiment stopTime="2"/>')
    write(tmp_path / "loop.ssp", ssd, "Plant_2", "Gain_2")
    assert "default experiment: stop time 2 s" in falsifier("info", "loop.ssp", cwd=tmp_path, code=0).out
    (tmp_path / "loop.toml").write_text(
        SPEC[SPEC.index("[model]") :].replace("[model]", '[model]\nfmu = "loop.ssp"').replace("10]", "2]")
    )
    text = (tmp_path / "loop.toml").read_text()
    (tmp_path / "loop.toml").write_text(f'{text}[coupling]\nmethod = "jacobi"\n')
    coupled = load_problem("loop.toml")
    assert isinstance(coupled.model, System) and coupled.model.coupling.method == "jacobi"
    assert coupled.experiment.stop_time == 2.0
    problem = load_problem("loop.ssp", stl="G[0,2] (plant.y <= 1.0)", inputs={"pi.r": (0.0, 2.0, 3)})
    assert falsify(problem, engine="corners", budget=2, directory=tmp_path / "run").falsified
    assert list(json.loads((tmp_path / "run" / "manifest.json").read_text())["hashes"]) == ["loop.ssp"]
    assert replay(load_counterexample(tmp_path / "run"), problem).status == "violates"
    write(tmp_path / "loop.ssp", ssd.replace('"root"', '"other"'), "Plant_2", "Gain_2")
    with pytest.raises(JournalError, match=r"loop\.ssp has changed since the start"):
        resume(tmp_path / "run")


def test_a_starter_names_what_could_be_connected(spec: Path, tmp_path: Path) -> None:
    done = falsifier("init", "Plant_2.fmu", "Gain_2.fmu", cwd=tmp_path, code=0)
    assert done.out.startswith("system.toml written")
    text = (tmp_path / "system.toml").read_text()
    assert '# "Plant_2.u" = "Gain_2.y"\n' in text and '# "Gain_2.measured" = "Plant_2.y"\n' in text
    connected = text.replace('# "Gain_2.measured"', '"Gain_2.measured"')
    (tmp_path / "system.toml").write_text(connected.replace("LIMIT", "1"))
    with pytest.raises(SpecError, match=r"inputs\.Gain_2\.measured: this input is connected to Plant_2\.y"):
        load_problem("system.toml")
    write(tmp_path / "loop.ssp", structure(system(PLANT + PI, FEEDBACK)), "Plant_2", "Gain_2")
    assert falsifier("init", "loop.ssp", "--out", "ssp.toml", cwd=tmp_path).code == 0
    (tmp_path / "ssp.toml").write_text((tmp_path / "ssp.toml").read_text().replace("LIMIT", "1"))
    assert load_problem("ssp.toml").space.names == ("pi.r",)
