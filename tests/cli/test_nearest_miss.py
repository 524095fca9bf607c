from pathlib import Path

from tests.command import falsifier


def test_a_run_that_falsified_nothing_is_asked_about_its_nearest_miss(tmp_path: Path) -> None:
    never = "python:tests.problems:impossible"
    falsifier("run", never, "--engine", "uniform", "--budget", "5", "--quiet", "--out", "r", cwd=tmp_path)
    told = [
        falsifier("explain", "r", *part, cwd=tmp_path)
        for part in ((), ("--shrink",), ("--map", "--budget", "7"))
    ]
    for done in told:
        assert done.code == 0, done.err
        assert "NEVER was not falsified in 5 simulations; this is about the nearest miss" in done.out
        assert "counterexample" not in done.out
    pictures = ("nearest-miss.png", "shrunk.png", "robustness-map.png")
    assert all((tmp_path / "r" / name).exists() for name in pictures)
    shrunk = falsifier("simulate", never, "--inputs", "r/shrunk.csv", cwd=tmp_path)
    assert shrunk.code == 0 and "not violated by these inputs" in shrunk.out
    refused = falsifier("explain", "r", "--map", "--at-most", "0.1", cwd=tmp_path)
    assert refused.code == 2 and "--at-most: applies to --shrink only" in refused.err
