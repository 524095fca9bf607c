import numpy as np
import pytest

from falsifier.core.trajectory import Trajectory
from falsifier.engines.surrogate.coarse import coarse_formula, inner_windows, sliding
from falsifier.stl import Monitor, parse

STEP = 0.5
SAMPLES = 41


def random_trajectory(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, (SAMPLES - 1) * STEP, SAMPLES)
    return Trajectory(times, {"x": rng.standard_normal(SAMPLES), "y": rng.standard_normal(SAMPLES)})


@pytest.mark.parametrize(
    "text",
    [
        "G[0,10] (x <= 1)",
        "F[2,10] (x > y)",
        "not G[0,10] (x <= 1 and y > 0)",
        "(G[0,10] (x <= 1)) -> (G[0,4] (y <= 0.5))",
        "(F[0,5] (x > 1)) <-> (F[0,5] (y > 1))",
        "G[0,10] F[0,5] (x >= 0.5)",
        "G[0,8] F[0,5] G[0,2] (x >= -0.5)",
        "(x > -1) U[1,6] (y > 0.5)",
        "not ((x > -1) U[1,6] (y > 0.5))",
        "G (x <= 3)",
        "X (x > 0)",
        "G[0,10] ((not (x > 0) and X (x > 0)) -> X G[0,2.5] (x > 0))",
    ],
)
def test_agrees_with_the_monitor_where_grid_and_samples_coincide(text: str) -> None:
    formula = parse(text)
    monitor = Monitor(formula, step=STEP, samples=SAMPLES)
    coarse = coarse_formula(formula, STEP)
    for seed in range(10):
        trajectory = random_trajectory(seed)
        margins = []
        for leaf in coarse.leaves:
            margin = leaf.margin(trajectory.columns)[None]
            if leaf.envelope != "sample":
                extreme = np.minimum if leaf.envelope == "low" else np.maximum
                cells = extreme(margin[:, :-1], margin[:, 1:])
                margin = np.concatenate([cells, margin[:, -1:]], axis=1)
            margins.append(margin)
        assert coarse.robustness(margins)[0] == pytest.approx(monitor.evaluate(trajectory).robustness)


def test_a_stretched_inner_window_is_harder_to_keep() -> None:
    formula = parse("F[0,10] G[0,2] (x >= 0)")
    trajectory = random_trajectory(3)
    values = []
    for stretch in (1.0, 2.0, 4.0):
        coarse = coarse_formula(formula, STEP, discrete=frozenset("x"), stretch=stretch)
        assert coarse.leaves[0].discrete
        values.append(coarse.robustness([coarse.leaves[0].margin(trajectory.columns)[None]])[0])
    assert values[0] >= values[1] >= values[2]
    assert values[0] > values[2]


def test_sliding_extremes_keep_the_last_value_beyond_the_end() -> None:
    values = np.array([[3.0, 1.0, 4.0, 1.5, 5.0]])
    assert sliding(values, 0, 2, np.minimum).tolist() == [[1.0, 1.0, 1.5, 1.5, 5.0]]
    assert sliding(values, 1, 3, np.maximum).tolist() == [[4.0, 5.0, 5.0, 5.0, 5.0]]


def test_inner_windows_and_joint_conditions_are_read_off_the_formula() -> None:
    assert inner_windows(parse("G[0,20] (x <= 1)")) == []
    assert inner_windows(parse("G[0,65] F[0,30] G[5,10] (x >= 8)")) == [30.0, 5.0]
    joint = [
        coarse_formula(parse(text), STEP).root.needs_several
        for text in ("G[0,5] (x <= 1)", "(G[0,5] (x <= 1)) and (y > 0)", "(G[0,5] (x <= 1)) -> (y > 0)")
    ]
    assert joint == [False, False, True]
