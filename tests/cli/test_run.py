import json
import re
import shutil
import signal
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import click
import pytest

from falsifier.cli import cli
from falsifier.cli.files import new_directory
from falsifier.core.files import bundled
from falsifier.errors import JournalError
from falsifier.record.journal import read_journal, recorded_candidates
from falsifier.record.run import falsify
from falsifier.testing import lag_problem
from tests.command import ROOT, falsifier, listen_to_interrupts
from tests.fmu.fixtures import path as fixture
from tests.patience import HANG, wait_until
from tests.pictures import CRITICAL, INPUT, OUTPUT, colours


def test_at1_is_falsified_from_the_bundled_fmu(tmp_path: Path) -> None:
    done = falsifier("run", "AT1", "--engine", "corners", "--json", "--out", "run", cwd=tmp_path, code=1)
    found = done.json["counterexample"]
    assert done.json["status"] == "falsified"
    assert found["robustness"] == pytest.approx(-0.2133, abs=1e-3)
    assert (found["critical_time"], found["predicate"]) == (20, "speed <= 120")
    assert set(found["signals"]["throttle"]["values"]) == {100}
    assert set(found["signals"]["brake"]["values"]) == {0}
    run = tmp_path / "run"
    assert {p.name for p in run.iterdir()} >= {"manifest.json", "journal.jsonl", "counterexample.json"}
    assert {OUTPUT, INPUT, CRITICAL} <= colours(run / "counterexample.png")
    manifest = json.loads((run / "manifest.json").read_text())
    assert (len(manifest["hashes"]), manifest["request"]["seed"]) == (2, 0)
    assert "confirmed" in done.err
    assert json.loads((run / "counterexample.json").read_text())["robustness"] == found["robustness"]


SPEED = ("my.fmu", "--stl", "G[0,20] (speed <= 120)")


def test_tasks_that_start_at_the_same_moment_have_a_directory_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("falsifier.cli.files.datetime", Mock(now=lambda: datetime(2026, 1, 2)))
    with click.Context(cli):
        places = [new_directory("AT1") for _ in range(3)]
        assert [p.name for p in places] == [f"AT1-20260102-000000{end}" for end in ("", "-2", "-3")]
        (places[1] / "manifest.json").touch()
    assert list(Path("runs").iterdir()) == [places[1]]


@pytest.mark.parametrize("was_there", [True, False])
def test_an_empty_folder_of_runs_goes_only_if_the_command_has_made_it(
    was_there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if was_there:
        Path("runs").mkdir()
    with click.Context(cli):
        new_directory("AT1")
    assert list(tmp_path.glob("**/*")) == [tmp_path / "runs"] * was_there


def test_a_folder_of_runs_that_another_task_removes_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("falsifier.cli.files.make_folder", lambda _: None)
    with click.Context(cli):
        assert new_directory("AT1").is_dir()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*SPEED, "--set", "throttle=50", "--set", "brake=0"), "nothing to search: --set keeps"),
        (("nosuch.fmu",), "nosuch.fmu: no such file"),
        (("folder.ssp", "--stl", "G (x <= 1)"), "folder.ssp is a folder; give"),
        (("folder.toml",), "folder.toml: cannot be read (Is a directory); expected"),
        (
            (*SPEED, "--search", "throttle=0-100"),
            "expected NAME=LOW:HIGH[:POINTS[:INTERPOLATION]], for example --search throttle=0:100:7",
        ),
        ((*SPEED, "--set", "throttle=0:100"), "to search a range: --search throttle=LOW:HIGH"),
        ((*SPEED, "--set", "airLoad=0:1"), "to search a range: --search airLoad=LOW:HIGH"),
        ((*SPEED, "--search", "speed"), "--search speed: cannot be set: the model computes"),
        ((*SPEED, "--set", "throttle=3", "--search", "throttle"), "drop one of them"),
        (("my.fmu", "--stl", "G (speed <= 1)", "--parameterization", "fixd"), "only specs have profiles"),
        (("AT1", "--parameterization", "free,fixed"), "for example instance2,fixed"),
        (("AT1", "--parameterization", "free:x"), "expected a time in s"),
        (("at1",), "did you mean 'AT1'?"),
        (("empty:R",), "did you mean 'empty.toml:R'?"),
        (("folder.fmu", "--stl", "G (speed <= 1)"), "folder.fmu is a folder; give"),
        (("AT1", "AT2"), "falsifier bench TARGET TARGET"),
        ((*SPEED, "--stop-time", "-5"), "--stop-time -5: expected a positive number"),
        ((*SPEED, "--search", "throttle=0:100:0"), "expected a number greater than or equal to 1, got 0"),
        (("empty.toml",), "empty.toml: the file contains nothing; write [model]"),
    ],
)
def test_what_newcomers_get_wrong_is_answered_with_what_to_write(
    command: Any, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "my.fmu").symlink_to(bundled("fmus") / "AT.fmu")
    (tmp_path / "empty.toml").write_text("# nothing yet\n")
    for ending in ("fmu", "ssp", "toml"):
        (tmp_path / f"folder.{ending}").mkdir()
    result = command("run", *arguments)
    assert result.exit_code != 0
    assert message in f"{result.output} {result.exception}"
    assert "Input should" not in str(result.exception)


def test_a_folder_is_resumed_without_the_runs_that_only_python_can_continue(
    command: Any, tmp_path: Path
) -> None:
    falsify(lag_problem(), budget=2, directory="a")
    command("run", "python:tests.problems:impossible", "--engine", "uniform", "--budget", "2", "--out", "b")
    result = command("resume", ".", code=0)
    assert "NEVER: not falsified after 2 simulations" in result.stdout
    assert "a: its problem was made in Python: call resume() with problems=[...]" in result.stderr
    assert isinstance(command("resume", "a").exception, JournalError)
    with pytest.raises(JournalError, match=r"choose another directory, .*resume\(\) with problems=\[...\]"):
        falsify(lag_problem(), budget=2, directory="a")


def test_a_folder_is_resumed_without_the_runs_that_exceed_the_budget(command: Any, tmp_path: Path) -> None:
    for name, budget in (("a", "2"), ("b", "4")):
        command("run", "python:tests.problems:impossible", "--budget", budget, "--out", name, code=0)
    result = command("resume", ".", "--budget", "3", code=0)
    assert "after 3 simulations" in result.stdout
    assert "b: this run has 4 simulations already" in result.stderr


def test_an_interrupted_folder_is_not_continued_with_the_next_run(
    command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b"):
        command("run", "python:tests.problems:impossible", "--budget", "2", "--out", name, code=0)

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("falsifier.search.steps.Steps.start", interrupt)
    shown = json.loads(command("resume", ".", "--budget", "4", "--json", code=130).stdout)
    assert shown["directory"] == "a"


def test_an_interrupted_run_is_kept_and_resumed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from falsifier.cli import main; main()", "run", "AT1"]
    options = ["--engine", "uniform", "--budget", "1000000", "--out", "run"]
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
    wait_until(lambda: journal.exists() and journal.read_text().count('"kind":"evaluated"') > 8)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=HANG)
    assert process.returncode == 130
    assert "interrupted" in out
    kept = sum(r.kind == "evaluated" for r in read_journal(tmp_path / "run"))
    assert kept > 5
    resumed = falsifier("resume", "run", "--budget", str(kept + 2), cwd=tmp_path, code=0)
    assert f"{kept} evaluations from the journal" in resumed.err
    assert f"after {kept + 2} simulations" in resumed.out


def test_a_run_in_which_most_simulations_fail_ends_with_three(tmp_path: Path) -> None:
    search = ("--search", "u=4.9:10:1", "--budget", "8", "--engine", "uniform")
    arguments = ("--stl", "G[0,10] (y <= 100)", *search)
    (tmp_path / "logs").mkdir()
    done = falsifier(
        "run", str(fixture("Silent_2")), *arguments, "--fmu-log", "logs/fmu.txt", cwd=tmp_path, code=3
    )
    assert re.search(r"stl: failed after 8 simulations, \d of them failed", done.out)
    assert re.search(r"warning: \d of \d simulations have failed", done.err)
    log = (tmp_path / "logs" / "fmu.txt").read_text()
    assert log.count("simulation ") == 8
    assert "  error: the solver did not converge: the valve is open too far" in log


SEVERAL = """
model = { fmu = 'AT.fmu', interface = 'co-simulation' }
inputs.throttle = { range = [0, 100], control_points = 2 }
requirements.A.formula = 'G[0,10] (speed <= 200)'
requirements.B = { formula = 'G[0,10] (speed <= 200)', stop_time = 12.0 }
"""


def test_a_folder_of_runs_is_told_from_one_of_them(tmp_path: Path) -> None:
    work = tmp_path / "work"
    work.mkdir()
    shutil.copy(bundled("fmus") / "AT.fmu", work)
    (work / "several.toml").write_text(SEVERAL)
    falsifier("run", "several.toml", "--budget", "1", "--quiet", "--out", "runs", cwd=work, code=0)
    for command in ("explain", "replay", "export", "coverage", "assess"):
        refused = falsifier(command, "runs", cwd=work, code=2)
        assert "runs is a folder of runs; give one of them: runs/A, runs/B" in refused.err
    shutil.copytree(work / "runs", work / "campaign" / "runs")
    shutil.copytree(work / "runs" / "A", work / "campaign" / "runs" / "C")
    shutil.copytree(work / "runs" / "A", work / "campaign" / "runs" / "D")
    for command in ("explain", "replay", "coverage", "assess"):
        refused = falsifier(command, "campaign", cwd=work, code=2)
        assert "campaign is a folder of runs; give one of them: campaign/runs/A, camp" in refused.err
        assert refused.err.strip().endswith("campaign/runs/C and 1 more")
    assert falsifier("resume", "runs", "--budget", "2", "--quiet", cwd=work).code == 0
    for option in (("--total", "simulations=8"), ("--jobs", "1")):
        assert "applies to campaigns only" in falsifier("resume", "runs/A", *option, cwd=work, code=2).err
    falsify("AT1", "corners", budget=1, directory=work / "other")
    shutil.copytree(work / "runs" / "A", work / "A")
    assert "is a folder of runs; give one of them: A, other" in falsifier("resume", ".", cwd=work, code=2).err
    elsewhere = falsifier("resume", "work/runs/A", cwd=tmp_path, code=2)
    assert "several.toml, which is not seen from this folder" in elsewhere.err


def test_searches_that_follow_each_other_share_known_inputs_and_one_log(tmp_path: Path) -> None:
    shutil.copy(bundled("fmus") / "AT.fmu", tmp_path)
    (tmp_path / "u.csv").write_text("time,throttle\n0,0\n25,80\n50,0\n")
    finer = "inputs.throttle = { range = [0, 100], control_points = 3 }"
    (tmp_path / "several.toml").write_text(SEVERAL.replace("stop_time = 12.0", finer))
    options = ("--engine", "corners", "--budget", "1", "--fmu-log", "log", "--inputs", "u.csv")
    done = falsifier("run", "several.toml", *options, "--out", "r", cwd=tmp_path, code=0)
    assert "--inputs from u.csv: throttle is sampled at 2 control points" in done.err
    (candidate,) = recorded_candidates(read_journal(tmp_path / "r" / "B")).values()
    assert candidate.signals["throttle"].values == (0.0, 80.0, 0.0)
    assert (tmp_path / "log").read_text().count("simulation 1: ok") == 2


def test_messages_of_the_fmu_replace_no_file_but_earlier_ones(tmp_path: Path) -> None:
    arguments = ("run", "AT1", "--budget", "1", "--quiet", "--fmu-log")
    own = tmp_path / "my.fmu"
    own.write_bytes(b"PK mine")
    refused = falsifier(*arguments, "my.fmu", cwd=tmp_path)
    assert (refused.code, own.read_bytes()) == (2, b"PK mine")
    assert "my.fmu exists and is kept: choose another name" in refused.err
    same = falsifier(*arguments, "lg", "--out", "lg", cwd=tmp_path, code=2)
    assert "--fmu-log lg: --out is" in same.err and not (tmp_path / "lg").exists()
    assert "no such folder gone" in falsifier(*arguments, "gone/log", cwd=tmp_path, code=2).err
    assert {path.name for path in tmp_path.iterdir()} == {"my.fmu"}
    assert [falsifier(*arguments, "log", cwd=tmp_path).code for _ in range(2)] == [0, 0]
    log = (tmp_path / "log").read_text()
    assert log.count("simulation ") == 1
    assert "simulation 1: ok" in falsifier(*arguments, "/dev/stderr", cwd=tmp_path).err
    assert falsifier(*arguments, "log", "--stl", "G[0,20] (nowhere < 3)", cwd=tmp_path).code == 2
    assert (tmp_path / "log").read_text() == log


def test_the_option_that_is_advised_finds_what_slow_inputs_cannot_express(tmp_path: Path) -> None:
    stl = ("--stl", "G[0,10] (u - y <= 1.5)", "--search", "u=-1:1:3", "--stop-time", "10")
    search = ("run", str(fixture("CheapLag_2")), *stl, "--budget", "30", "--json")
    slow = falsifier(*search, "--out", "slow", cwd=tmp_path, code=0)
    (advised,) = re.findall(r"--parameterization free:[\d.]+\d", slow.json["findings"][-1]["text"])
    assert falsifier(*search, "--out", "fast", *advised.split(), cwd=tmp_path).code == 1
