from pathlib import Path

from tests.command import falsifier

NEVER = "python:tests.problems:impossible"


def test_what_a_run_tried_is_printed_and_drawn(tmp_path: Path) -> None:
    falsifier("run", NEVER, "--engine", "corners", "--budget", "4", "--out", "r", cwd=tmp_path)
    done = falsifier("coverage", "r", cwd=tmp_path)
    assert done.code == 0, done.err
    for part in ("NEVER: what 4 simulations tried", "u [V]", "never tried", "x [m]", "r/coverage.png"):
        assert part in done.out, done.out
    assert (tmp_path / "r" / "coverage.png").read_bytes().startswith(b"\x89PNG")


def test_as_json(tmp_path: Path) -> None:
    falsifier("run", NEVER, "--engine", "corners", "--budget", "2", "--out", "r", cwd=tmp_path)
    done = falsifier("coverage", "r", "--json", "--out", "c.png", cwd=tmp_path)
    assert done.json["simulations"] == 2
    assert done.json["picture"] == "c.png" and (tmp_path / "c.png").exists()


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    done = falsifier("coverage", ".", cwd=tmp_path)
    assert done.code == 2 or done.code == 3
    assert "not a run directory" in done.err
