"""What tables of measurements say of few runs, and of a tool that fails."""

from pathlib import Path

import pytest

from bench.peers import peer_search
from bench.search import with_error
from falsifier import load_problem


@pytest.mark.parametrize(
    ("values", "text"), [([], "–"), ([3], "3.0"), ([1, 3], "2.0 ± 1.0"), ([1, 2, 3, 4], "2.5 ± 0.6")]
)
def test_a_single_value_has_no_standard_error(values: list[float], text: str) -> None:
    assert with_error(values) == text


def test_another_tool_that_fails_has_not_missed(tmp_path: Path) -> None:
    tool = tmp_path / "python"
    tool.write_text("#!/bin/sh\nread -r line\nexit 1\n")
    tool.chmod(0o700)
    problem = load_problem("AT1", parameterization="fixed")
    with pytest.raises(SystemExit, match="failed after 0 simulations"):
        peer_search(problem, "uniform", tool, seed=1, budget=3)
