"""A system of FMUs is searched, recorded, resumed, replayed and sent to workers as one FMU is."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from falsifier import Problem, confirm, evaluate, falsify, resume
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.store import load, problem_of, replay
from falsifier.errors import JournalError
from falsifier.fmu import fmu_files
from tests.command import falsifier
from tests.fmu.fixtures import path
from tests.fmu.systems import loop

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


def test_from_the_command_line_to_the_counterexample_and_back(spec: Path, tmp_path: Path) -> None:
    done = falsifier("run", "loop.toml", "--out", "run", "--engine", "corners", "--budget", "5", cwd=tmp_path)
    assert done.code == 1, done.err
    assert "plant.u uses the values of the previous communication point" in done.err
    assert "half the communication step (0.05 s)" in done.out
    hashes = json.loads((tmp_path / "run" / "manifest.json").read_text())["hashes"]
    assert sorted(Path(p).name for p in hashes) == ["Gain_2.fmu", "Plant_2.fmu", "loop.toml"]
    (again,) = resume(tmp_path / "run")
    assert again.falsified and again.spent.simulations == 1

    stored = load(tmp_path / "run")
    replayed = replay(stored, problem_of(stored))
    assert replayed.status == "violates" and replayed.text.startswith("R: still violated")
    (tmp_path / "Gain_2.fmu").write_bytes(path("Gain_3").read_bytes())
    assert "an FMU of the system has changed" in replay(stored, problem_of(stored)).text
    with pytest.raises(JournalError, match=r"Gain_2\.fmu has changed since the start"):
        resume(tmp_path / "run")


def test_other_connections_are_another_problem(spec: Path, tmp_path: Path) -> None:
    falsifier("run", "loop.toml", "--out", "run", "--engine", "corners", "--budget", "1", cwd=tmp_path)
    spec.write_text(SPEC.replace('"pi.measured" = "plant.y"\n', ""))
    with pytest.raises(JournalError, match="has changed since the start"):
        resume(tmp_path / "run")


def test_info_and_check_show_the_system(spec: Path, tmp_path: Path) -> None:
    shown = falsifier("info", "loop.toml", cwd=tmp_path)
    assert shown.code == 0
    assert "Connections: pi.y -> plant.u, plant.y -> pi.measured" in shown.out
    assert falsifier("check", "loop.toml", cwd=tmp_path).out.startswith("R: ok, G[0,10] (plant.y <= 1.2)")
    refused = falsifier("build", "loop.toml", cwd=tmp_path)
    assert (refused.code, refused.err) == (
        2,
        "falsifier: loop.toml is a system of FMUs; give one of them: plant, pi\n",
    )


def test_a_problem_made_in_python_is_searched() -> None:
    problem = Problem.from_system(
        loop(), "G[0,10] (plant.y <= 1.2)", inputs={"pi.r": (0.0, 2.0, 3)}, output_interval=0.1
    )
    assert falsify(problem, engine="corners", budget=3).falsified
    everything = Problem.from_system(loop(), "G[0,10] (plant.y <= 1.2)")
    assert everything.space.names == ("pi.r",), "inputs with limits that nothing feeds"


def test_what_only_the_coupling_violates_is_fragile() -> None:
    """With a gain of 30 the loop oscillates at a step of 0.1 s, and does not at half of it."""
    problem = Problem.from_system(
        loop(), "G[0,5] (plant.y <= 1.3)", parameters={"pi.k": 30.0}, inputs={"pi.r": (0.0, 1.0, 1)},
        stop_time=5.0, output_interval=0.1,
    )  # fmt: skip
    found = evaluate(problem, Candidate({"pi.r": Signal((0.0,), (1.0,))}, {}, "test"))
    assert found.violated
    confirmation = confirm(problem, found)
    assert confirmation.outcome == "fragile"
    assert "half the communication step (0.05 s)" in confirmation.reason


def test_workers_get_the_files_that_they_miss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from falsifier.campaigns.work import Missing, _with_local_fmus

    monkeypatch.setenv("FALSIFIER_STORE", str(tmp_path / "store"))
    folder = tmp_path / "there"
    folder.mkdir()
    for name in ("Plant_2", "Gain_2"):
        (folder / f"{name}.fmu").write_bytes(path(name).read_bytes())
    from falsifier import System

    system = System(
        {"plant": folder / "Plant_2.fmu", "pi": folder / "Gain_2.fmu"}, {"plant.u": "pi.y"}, isolate=False
    )
    problem = Problem.from_system(system, "G[0,1] (plant.y <= 5)", stop_time=1.0)
    contents = {digest: file.read_bytes() for file, digest in fmu_files(system).items()}
    for file in fmu_files(system):
        file.unlink()
    for digest, content in contents.items():
        assert _with_local_fmus(problem, {}) == Missing(digest)
        local = _with_local_fmus(problem, {digest: content})
    assert isinstance(local, Problem)
    candidate = Candidate({"pi.r": Signal((0.0,), (1.0,))}, {}, "test")
    assert evaluate(replace(local), candidate).robustness is not None


def test_no_key_reaches_a_component(monkeypatch: pytest.MonkeyPatch) -> None:
    from falsifier.fmu.isolation import REGISTRY
    from tests.fmu.systems import LOOP, run, system

    REGISTRY.close()  # so that the next worker would see the variable
    monkeypatch.setenv("OPENAI_API_KEY", "sk-only-in-this-test")
    model = system({"plant": "Plant_2", "pi": "Gain_2"}, LOOP, isolate=True)
    run(model, "plant.y")
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.key]
    assert fmu._worker is not None
    environment = Path(f"/proc/{fmu._worker.pid}/environ").read_bytes()
    assert b"PATH" in environment
    assert b"sk-only-in-this-test" not in environment
    model.close()
