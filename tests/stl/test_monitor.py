import numpy as np
import pytest

from falsifier.stl import Monitor
from falsifier.trajectory import Trajectory
from tests.stl.direct import Direct
from tests.stl.randoms import STEP, random_case


def trajectory(step: float = 1.0, **columns: list[float]) -> Trajectory:
    n = len(next(iter(columns.values())))
    return Trajectory(
        np.arange(n, dtype=np.float64) * step, {name: np.array(c, dtype=float) for name, c in columns.items()}
    )


@pytest.mark.parametrize("block", range(10))
def test_random_formulas_agree_with_the_direct_definition(block: int) -> None:
    for seed in range(block * 400, (block + 1) * 400):
        formula, t = random_case(seed)
        verdict = Monitor(formula, STEP, len(t)).evaluate(t)
        robustness, sample = Direct(t.columns, STEP).judge(formula)
        assert (verdict.robustness, verdict.critical_time) == (robustness, t.times[sample]), (
            seed,
            str(formula),
        )
