from pathlib import Path

from falsifier.record.run import falsify
from tests.cli.support import HARD, NEVER
from tests.command import falsifier


def test_a_system_without_violations_gets_a_bound(tmp_path: Path) -> None:
    done = falsifier("assess", NEVER, "--budget", "60", cwd=tmp_path, code=0)
    for part in ("NEVER: ", "0 of 60 random simulations", "at most 0.0488"):
        assert part in done.out
    found = falsifier("assess", NEVER, "--budget", "60", "--json", cwd=tmp_path).json
    assert (found["spent"], found["violations"], found["findings"]) == ({"simulations": 60}, 0, [])


def test_violations_are_counted_and_decide_the_exit_code(tmp_path: Path) -> None:
    done = falsifier("assess", HARD, "--budget", "100", "--seed", "2", "--json", cwd=tmp_path, code=1)
    low, high = done.json["interval"]
    assert low < done.json["violations"] / 100 < high
    assert "simulation 100 of at most 100" in done.err


def test_the_threshold_is_printed_between_two_values(tmp_path: Path) -> None:
    vary = ["--stl", "G[0,10] (x <= {limit})", "--between", "0:3", "--engine", "corners"]
    done = falsifier("margin", NEVER, *vary, "--budget", "40", "--json", cwd=tmp_path, code=1)
    assert 0.95 < done.json["falsified_at"] < done.json["unfalsified_at"] < 1.05
    assert done.json["searches"][0] == {"threshold": 3.0, "falsified": False}
    assert "3: not falsified" in done.err


def test_a_range_that_is_none_is_refused(tmp_path: Path) -> None:
    for wrong, said in (
        (["--stl", "x <= {limit}", "--between", "100"], "--between 100"),
        (["--stl", "x <= 1", "--between", "0:3"], "--stl: expected {limit} in place of the th"),
        (["--stl", "x <= {limit}", "--between", "0:3", "--budget", "9"], "a whole number from 20"),
        (["--stl", "G[0,{limit}] (x <= 1)", "--between", "1:30"], "--stl with {limit} = 30: "),
        (["--stl", "x <= 2 + 0*{limit}", "--between", "1:3"], "--stl: the robustness is the same"),
        (["--stl", "x <= {limit}", "--between", "3:1"], "--between 3:1: expected LOW:HIGH with LOW < HIGH"),
    ):
        assert said in falsifier("margin", NEVER, *wrong, cwd=tmp_path, code=2).err


def test_a_run_is_assessed_in_its_own_space_beside_what_it_found(tmp_path: Path) -> None:
    falsifier("run", NEVER, "--engine", "corners", "--budget", "5", "--out", "r", "--quiet", cwd=tmp_path)
    done = falsifier("assess", "r", "--budget", "20", "--json", cwd=tmp_path, code=0)
    assert done.json["requirement"] == "NEVER" and done.json["spent"]["simulations"] == 20
    search = done.json["search"]
    assert search["simulations"] == 5 and 0.99 < search["smallest_robustness"] < 1.01
    assert "drop --stl" in falsifier("assess", "r", "--stl", "x <= 1", cwd=tmp_path, code=2).err
    falsify("python:tests.stepped:euler_problem", "corners", budget=2, directory=tmp_path / "fragile")
    refused = falsifier("assess", NEVER, "--parameterization", "free:2", cwd=tmp_path)
    assert refused.code == 2 and "free:SECONDS: the fixed control points are drawn; drop" in refused.err
    doubted = falsifier("assess", "fragile", "--budget", "5", "--quiet", cwd=tmp_path)
    assert " (1 violation, not confirmed)." in doubted.out


def test_a_run_of_several_requirements_asks_which_one_is_assessed(tmp_path: Path) -> None:
    falsify([NEVER, HARD], "corners", budget=5, directory=tmp_path / "r")
    asked = falsifier("assess", "r", "--budget", "20", "--quiet", cwd=tmp_path, code=2)
    assert "NEVER, HARD; choose one: --requirement NAME" in asked.err
    done = falsifier("assess", "r", "--requirement", "HARD", "--budget", "20", "--quiet", cwd=tmp_path)
    assert done.out.startswith("HARD: ") and "The search found a violation in" in done.out
