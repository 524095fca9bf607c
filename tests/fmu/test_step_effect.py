import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu.step_effect import Movement, step_convergence
from tests.fmu.fixtures import local, ramp


def test_halving_the_step_moves_outputs_by_half_the_error_of_holding() -> None:
    """A held ramp lags by half a step: x is off by h / 2 (1 - exp(-t / T)), and half of that moves."""
    model = local("Lag_2")
    moved = step_convergence(model, Experiment(4.0, 0.1, ("x", "T")), {"u": ramp(4.0)})
    assert moved["x"].largest == pytest.approx(0.1 / 4 * (1 - np.exp(-2.0)), rel=0.03)
    assert moved["x"].time == pytest.approx(4.0)
    assert moved["T"] == Movement(0.0, 0.0, 0.0)
    assert moved["T"].relative == 0.0
    finer = step_convergence(model, Experiment(4.0, 0.1, ("x",), step_size=0.01), {"u": ramp(4.0)})
    assert finer["x"].relative == pytest.approx(0.1 * moved["x"].relative, rel=0.05)
