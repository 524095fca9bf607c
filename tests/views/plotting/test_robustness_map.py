from pathlib import Path

import pytest

from falsifier.core.space import ParameterRange
from falsifier.counterexamples.robustness_map import robustness_map
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import lag_problem
from falsifier.views.plotting import plot_robustness_map, save_figure

# x(10) of x' = u - x, x(0) = x0, by Euler with 0.1 s: u + (x0 - u) 0.9**100. The range of u is 2 wide.
X0 = ParameterRange("x0", -1.0, 1.0, nominal=0.0)


@pytest.mark.parametrize("parameters", [(), (X0,)])
def test_the_map_is_drawn(tmp_path: Path, parameters: tuple[ParameterRange, ...]) -> None:
    lag = lag_problem(parameters=parameters)
    start = evaluate(lag, lag.space.decode([1.0] * len(lag.space.dimensions)))
    found = robustness_map(lag, start, samples=8, points=3)
    save_figure(plot_robustness_map(found, "LAG"), tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
