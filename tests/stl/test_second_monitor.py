import random

import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.errors import FormulaError, MonitorError
from falsifier.stl import Monitor, parse, second_monitor
from tests.stl.randoms import STEP, random_formula, random_trajectory


@pytest.mark.parametrize("block", range(7))
def test_random_formulas_agree_with_rtamt(block: int) -> None:
    for seed in range(10_000 + block * 300, 10_000 + (block + 1) * 300):
        rng = random.Random(seed)
        formula = random_formula(rng, rng.randint(0, 3), windows=block < 5)
        t = random_trajectory(rng, rng.randint(1, 9) + round(formula.horizon(STEP) / STEP))
        ours = Monitor(formula, STEP, len(t)).evaluate(t).robustness
        assert second_monitor.robustness(formula, t) == ours, (seed, str(formula))


@pytest.mark.parametrize(
    "text",
    [
        "G[0,20] (speed <= 120)",
        "(G[0,30] (rpm <= 3000)) -> (G[0,8] (speed <= 50))",
        "G[0,30] ((not (abs(gear - 2) <= 0.5) and X (abs(gear - 2) <= 0.5)) -> X G[0,2.5] (gear >= 1.5))",
        "(speed >= 10) U[5,30] (rpm >= 3400)",
        "G[0,10] F[1,3] (sin(speed) * sqrt(rpm) - speed/2 >= max(0, rpm^1.5/1e4))",
        '"wheel speed" <= 3 <-> der(x) >= 0.001',
    ],
)
def test_requirements_agree_on_smooth_trajectories(text: str) -> None:
    t = np.linspace(0.0, 50.0, 501)
    columns = {
        "speed": 60 + 60 * np.sin(t / 7),
        "rpm": 3000 + 1500 * np.sin(t / 5),
        "gear": np.round(2 + 1.4 * np.sin(t / 3)),
        "wheel speed": np.cos(t),
        "der(x)": 1e-7 * t,
    }
    trajectory = Trajectory(t, columns)
    ours = Monitor(parse(text), 0.1, 501).evaluate(trajectory).robustness
    assert second_monitor.robustness(parse(text), trajectory) == pytest.approx(ours, rel=1e-12)


def test_what_cannot_be_judged_is_an_error() -> None:
    t = Trajectory(np.arange(3.0), {"x": np.array([1.0, np.nan, 1.0])})
    with pytest.raises(MonitorError, match="no finite value at 1 s"):
        second_monitor.robustness(parse("G (x <= 3)"), t)
    with pytest.raises(MonitorError, match="no signal 'y'"):
        second_monitor.robustness(parse("G (y <= 3)"), t)
    with pytest.raises(MonitorError, match="needs 5 s"):
        second_monitor.robustness(parse("G[0,5] (x <= 3)"), t)
    with pytest.raises(FormulaError, match="multiple"):
        second_monitor.robustness(parse("G[0,1.5] (x <= 3)"), t)


@pytest.mark.parametrize(
    "text", ["G[1,2] (1/x > 0)", "X (1/x != 3) and F[2,2] (1/x == -1)", "X G (1/x >= -1)"]
)
def test_what_has_no_value_while_it_does_not_matter_is_judged(text: str) -> None:
    t = Trajectory(np.arange(3.0), {"x": np.array([0.0, -1.0, -1.0])})
    assert second_monitor.robustness(parse(text), t) == Monitor(parse(text), 1.0, 3).evaluate(t).robustness


def test_windows_that_are_each_a_little_off_the_grid_fit_together() -> None:
    off = 1 + 8e-7  # of the first sample, so within the tolerance
    formula = parse(f"G[0,{off}] F[0,{off}] G[0,{off}] (x <= 3)")
    t = Trajectory(np.arange(4.0), {"x": np.ones(4)})
    assert Monitor(formula, 1.0, 4).evaluate(t).robustness == second_monitor.robustness(formula, t) == 2.0


def test_a_comparison_of_constants_needs_no_signal() -> None:
    assert second_monitor.robustness(parse("G (1 <= 3)"), Trajectory(np.arange(3.0), {})) == 2.0


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    second_monitor.robustness(parse("G[0,1] (x <= 3)"), Trajectory(np.arange(3.0), {"x": np.ones(3)}))
    assert capfd.readouterr() == ("", "")
