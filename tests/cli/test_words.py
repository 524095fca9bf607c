from pathlib import Path

from tests.command import falsifier
from tests.problem.support import spec
from tests.search.test_lint import SPEC

WIDE = SPEC + "[requirements.R]\nformula = 'G[0,20] (throttle <= 100)'\n"


def test_lint_prints_requirement_place_and_what_to_do(tmp_path: Path) -> None:
    done = falsifier("lint", spec(tmp_path, WIDE), cwd=tmp_path)
    assert done.code == 1, done.err
    assert "R: always: no trajectory in range violates it" in done.out
    assert "  in      G[0,20] (throttle <= 100)" in done.out
    assert "  to do   check threshold" in done.out
    found = falsifier("lint", "my.toml", "--json", cwd=tmp_path)
    assert found.code == 1
    assert [f["kind"] for f in found.json] == ["always"]  # type: ignore[index]


def test_lint_finds_nothing_in_a_bundled_spec(tmp_path: Path) -> None:
    done = falsifier("lint", "CC1", "--simulations", "0", cwd=tmp_path)
    assert (done.code, done.out) == (0, "nothing found\n")
