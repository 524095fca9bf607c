import numpy as np
import pytest

from falsifier.errors import FormulaError, MonitorError
from falsifier.stl import Monitor, parse, reference
from falsifier.trajectory import Trajectory
from tests.stl.randoms import STEP, random_case


@pytest.mark.parametrize("block", range(5))
def test_random_formulas_agree_with_rtamt(block: int) -> None:
    for seed in range(10_000 + block * 300, 10_000 + (block + 1) * 300):
        formula, t = random_case(seed, depth=3)
        ours = Monitor(formula, STEP, len(t)).evaluate(t).robustness
        assert reference.robustness(formula, t) == ours, (seed, str(formula))
