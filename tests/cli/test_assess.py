import json
from pathlib import Path

from tests.command import falsifier

HARD, NEVER = "python:tests.problems:hard", "python:tests.problems:impossible"


def test_a_system_without_violations_gets_a_bound(tmp_path: Path) -> None:
    done = falsifier("assess", NEVER, "--budget", "60", "--out", "o", cwd=tmp_path)
    assert done.code == 0, done.err
    for part in (
        "NEVER: ",
        "0 of 60 random simulations",
        "at most 0.0487",
        "4 control points",
        "o/assurance.json",
    ):
        assert part in done.out
    recorded = json.loads((tmp_path / "o" / "assurance.json").read_text())
    assert (recorded["drawn"], recorded["violations"], recorded["estimate"]) == (60, 0, None)


def test_violations_are_counted_and_decide_the_exit_code(tmp_path: Path) -> None:
    done = falsifier("assess", HARD, "--budget", "100", "--seed", "2", "--json", cwd=tmp_path)
    assert done.code == 1, done.err
    low, high = done.json["interval"]
    assert low < done.json["violations"] / 100 < high
    assert "simulation 100 of at most 100" in done.err
