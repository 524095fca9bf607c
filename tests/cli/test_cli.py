import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.search.journal import read_journal, write_manifest
from tests.command import ROOT, falsifier, listen_to_interrupts


def test_at1_is_falsified_from_the_bundled_fmu(tmp_path: Path) -> None:
    done = falsifier("run", "AT1", "--engine", "corners", "--json", "--out", "run", cwd=tmp_path)
    assert done.code == 1, done.err
    found = done.json["counterexample"]
    assert done.json["status"] == "falsified"
    assert found["robustness"] == pytest.approx(-0.2133, abs=1e-3)
    assert found["critical_time"] == 20
    assert found["predicate"] == "speed <= 120"
    assert set(found["signals"]["throttle"]["values"]) == {100}
    assert set(found["signals"]["brake"]["values"]) == {0}
    run = tmp_path / "run"
    assert {p.name for p in run.iterdir()} >= {"manifest.json", "journal.jsonl", "counterexample.json"}
    assert (run / "counterexample.png").read_bytes().startswith(b"\x89PNG")
    manifest = json.loads((run / "manifest.json").read_text())
    assert len(manifest["hashes"]) == 2
    assert manifest["request"]["seed"] == 0
    assert "confirmed" in done.err
    assert json.loads((run / "counterexample.json").read_text())["robustness"] == found["robustness"]


def test_the_text_names_what_was_found_and_where_it_is(tmp_path: Path) -> None:
    done = falsifier("run", "AT1", "--engine", "corners", "--quiet", "--out", "run", cwd=tmp_path)
    assert done.err == ""
    for part in (
        "AT1: falsified after",
        "-0.213",
        "critical time  20 s",
        "speed = 120.2",
        "constant 100",
        "run",
    ):
        assert part in done.out


def test_a_used_up_budget_ends_with_zero(tmp_path: Path) -> None:
    done = falsifier(
        "run", "AT1", "--engine", "uniform", "--budget", "3", "--param", "finalDrive=3", cwd=tmp_path
    )
    assert done.code == 0, done.err
    assert "not falsified after 3 simulations" in done.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "AT1", "--stl", "G[0,20] (sped <= 120)"], "did you mean 'speed'"),
        (["run", "AT1", "--engine", "corner"], "did you mean 'corners'"),
        (["run", "AT1", "--input", "throtle=0:100:7"], "did you mean 'throttle'"),
        (["run", "AT1", "--budget", "0"], "simulations must be positive"),
        (["run", "AT1", "--budget", "many"], "many"),
        (["run", "AT1", "--effort", "low"], "add --llm NAME"),
        (["run", "gone.toml"], "no such spec file"),
        (["run", "gone.fmu", "--stl", "G (x >= 0)"], "gone.fmu: no such file"),
        (["run", "gone.fmu"], "--stl"),
        (["resume", "nowhere"], "not a run directory"),
        (["info", "gone.fmu"], "gone.fmu: no such file"),
        (["rn", "AT1"], "did you mean 'run'"),
        (
            ["run", "AT9"],
            "CC5, CCx, NNb, NNx\n",
        ),
        (["run", "AT1", "--llm", "openai/gpt-5-mini"], "set OPENAI_API_KEY"),
        (["run", "AT1", "--llm", "opnai/x", "--variant", "MP9"], "unknown prompt variant 'MP9'"),
        (["run", "AT1", "--llm", "opnai/x", "--fallback", "corner"], "did you mean 'corners'"),
        (["run", "AT1", "--llm", "opnai/x", "--fallback", "hybrid"], "does not use a language model"),
        (["run", "AT1", "--llm", "gpt-5-mini"], "expected PROVIDER/MODEL"),
        (["llm", "check", "openai/gpt-5-mini"], "set OPENAI_API_KEY"),
        (["bench", "AT1", "--llm", "openai/gpt-5-mini"], "set OPENAI_API_KEY"),
        (["bench", "AT1", "--engine", "corner"], "did you mean 'corners'"),
    ],
)
def test_wrong_usage_ends_with_two_and_says_what_to_do(
    tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = falsifier(*arguments, cwd=tmp_path)
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert done.out == ""


def test_wrong_names_are_told_without_loading_what_takes_seconds(tmp_path: Path) -> None:
    """A stand-in for litellm that cannot be imported is never asked for."""
    (tmp_path / "litellm.py").write_text("raise ImportError('this is imported')")
    path = {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    wrong = {"--variant": "MP9", "--fallback": "corner", "--engine": "uniform"}
    for option, value in wrong.items():
        done = falsifier("run", "AT1", "--llm", "nobody/x", option, value, cwd=tmp_path, env=path)
        assert (done.code, "imported" in done.err) == (2, False), done.err
    done = falsifier("run", "AT1", "--llm", "openai/x", "--max-cost", "1", cwd=tmp_path, env=path)
    assert (done.code, "OPENAI_API_KEY" in done.err) == (2, True), done.err
    done = falsifier("run", "AT1", "--llm", "nobody/x", cwd=tmp_path, env=path)
    assert (done.code, "imported" in done.err) == (3, True), done.err


def test_an_input_by_its_name_alone_takes_the_range_that_is_known(tmp_path: Path) -> None:
    fmu, stl = str(bundled("fmus") / "AT.fmu"), "G[0,20] (speed <= 200)"
    common = ("--engine", "corners", "--budget", "1", "--quiet", "--json")
    done = falsifier("run", fmu, "--stl", stl, "--input", "throttle", *common, cwd=tmp_path)
    assert done.json["best"]["signals"].keys() == {"throttle"}
    assert done.json["best"]["signals"]["throttle"]["values"] == [100.0] * 5
    manifest = json.loads((Path(tmp_path) / done.json["directory"] / "manifest.json").read_text())
    assert [(i["name"], i["low"], i["high"]) for i in manifest["inputs"]] == [("throttle", 0.0, 100.0)]


def test_an_fmu_that_is_none_is_said_plainly(tmp_path: Path) -> None:
    (tmp_path / "bad.fmu").write_bytes(b"this is no archive")
    done = falsifier("run", "bad.fmu", "--stl", "G (x >= 0)", cwd=tmp_path)
    assert done.code == 3
    assert "bad.fmu" in done.err
    assert "Traceback" not in done.err


def test_info_shows_units_ranges_and_descriptions(tmp_path: Path) -> None:
    done = falsifier("info", "AT.fmu", cwd=tmp_path)
    assert done.code == 0, done.err
    for part in (
        "FMI 2.0",
        "throttle",
        "%",
        "325",
        "ft.lbf",
        "Vehicle speed",
        "co-simulation, model-exchange",
    ):
        assert part in done.out
    described = falsifier("info", "AT.fmu", "--json", cwd=tmp_path).json
    assert {v["name"] for v in described["variables"]} >= {"throttle", "brake", "speed", "rpm", "gear"}


def test_info_says_what_cannot_be_simulated(tmp_path: Path) -> None:
    fixtures = ROOT / "tests" / "fixtures" / "fmus"
    clocked = falsifier("info", str(fixtures / "Clocked_3.fmu"), cwd=tmp_path)
    assert "cannot be simulated: its input clocks (tick) need external ticks" in clocked.out
    scheduled = falsifier("info", str(fixtures / "Scheduled_3.fmu"), cwd=tmp_path)
    assert "scheduled execution is not supported" in scheduled.out


def test_info_takes_a_spec_for_its_fmu(tmp_path: Path) -> None:
    spec = bundled("specs") / "AT.toml"
    assert (
        falsifier("info", str(spec), cwd=tmp_path).out
        == falsifier("info", str(bundled("fmus") / "AT.fmu"), cwd=tmp_path).out
    )


def test_init_writes_a_spec_that_runs(tmp_path: Path) -> None:
    shutil.copy(bundled("fmus") / "AT.fmu", tmp_path / "car.fmu")
    assert falsifier("init", "car.fmu", cwd=tmp_path).code == 0
    again = falsifier("init", "car.fmu", cwd=tmp_path)
    assert (again.code, "--force" in again.err) == (2, True)
    assert falsifier("check", "car.toml", cwd=tmp_path).code == 0
    assert falsifier("run", "car.toml", "--engine", "uniform", "--budget", "2", cwd=tmp_path).code == 0


def test_check_names_all_requirements(tmp_path: Path) -> None:
    done = falsifier("check", "AT", cwd=tmp_path)
    assert done.code == 0
    assert done.out.count(": ok") == 10


def test_schema_describes_spec_files(tmp_path: Path) -> None:
    schema = falsifier("schema", cwd=tmp_path).json
    assert set(schema["properties"]) == {"model", "inputs", "parameters", "requirements", "profiles"}


def test_an_interrupted_run_is_kept_and_resumed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from falsifier.cli import main; main()", "run", "AT1"]
    options = ["--engine", "uniform", "--budget", "5000", "--out", "run"]
    process = subprocess.Popen(
        [*command, *options],
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=listen_to_interrupts,
    )
    journal = tmp_path / "run" / "journal.jsonl"
    until = time.monotonic() + 60
    while time.monotonic() < until and not (
        journal.exists() and journal.read_text().count('"evaluated"') > 5
    ):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in out
    kept = sum(r.kind == "evaluated" for r in read_journal(tmp_path / "run"))
    assert kept > 5
    request = json.loads((tmp_path / "run" / "manifest.json").read_text())
    request["request"]["budget"]["simulations"] = kept + 2
    write_manifest(tmp_path / "run", request)
    resumed = falsifier("resume", "run", cwd=tmp_path)
    assert resumed.code == 0, resumed.err
    assert f"{kept} evaluations from the journal" in resumed.err
    assert f"after {kept + 2} simulations" in resumed.out


def test_a_run_directory_is_not_overwritten(tmp_path: Path) -> None:
    options = ("run", "AT1", "--engine", "uniform", "--budget", "1", "--out", "run", "--quiet")
    assert falsifier(*options, cwd=tmp_path).code == 0
    again = falsifier(*options, cwd=tmp_path)
    assert again.code == 2
    assert "falsifier resume run" in again.err


def test_help_is_fast_and_names_the_commands(tmp_path: Path) -> None:
    falsifier("--help", cwd=tmp_path)  # compiled modules are on disk from here on
    started = time.perf_counter()
    done = falsifier("--help", cwd=tmp_path)
    assert time.perf_counter() - started < 1.5  # 0.5 s on an idle machine, see bench/
    assert done.code == 0
    for name in ("run", "info", "check", "prompt", "resume"):
        assert f"  {name}" in done.out


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = falsifier("run", "AT1", "--engine", "uniform", "--budget", "1", "--out", "file/run", cwd=tmp_path)
    assert done.code == 2
    assert "file/run" in done.err
    assert "Traceback" not in done.err


def test_a_closed_pipe_is_not_a_falsification(tmp_path: Path) -> None:
    program = f"{sys.executable} -c 'from falsifier.cli import main; main()'"
    command = program + " info AT.fmu | true; echo ${PIPESTATUS[0]}"
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "141"
    assert "Traceback" not in done.stderr


def test_nothing_is_written_for_an_fmu_that_cannot_be_simulated(tmp_path: Path) -> None:
    shutil.copy(ROOT / "tests" / "fixtures" / "fmus" / "Scheduled_3.fmu", tmp_path)
    done = falsifier("init", "Scheduled_3.fmu", cwd=tmp_path)
    assert done.code == 3
    assert "scheduled execution is not supported" in done.err
    assert not (tmp_path / "Scheduled_3.toml").exists()
