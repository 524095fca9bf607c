from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.evaluation.confirm import Movement, step_convergence, sufficient_step
from falsifier.fmu import Frame
from tests.fmu.fixtures import isolated, ramp
from tests.fmu.small_systems import loop


def test_halving_the_step_moves_outputs_by_half_the_error_of_holding() -> None:
    """A held ramp lags by half a step: x is off by h / 2 (1 - exp(-t / T)), and half of that moves."""
    model = isolated("Lag_2")
    moved = step_convergence(model, Experiment(4.0, 0.1, ("x", "T")), {"u": ramp(4.0)})
    assert moved["x"].largest == pytest.approx(0.1 / 4 * (1 - np.exp(-2.0)), rel=0.03)
    assert moved["x"].time == pytest.approx(4.0)
    assert moved["T"] == Movement(0.0, 0.0, 0.0)
    assert moved["T"].relative == 0.0
    finer = step_convergence(model, Experiment(4.0, 0.1, ("x",), step_size=0.01), {"u": ramp(4.0)})
    assert finer["x"].relative == pytest.approx(0.1 * moved["x"].relative, rel=0.05)


def test_the_step_that_a_coupling_needs_is_found() -> None:
    """With a gain of 30 and a time constant of 2 s, the loop is stable below a step of some 0.13 s."""
    experiment = Experiment(4.0, 0.2, ("plant.y",))
    model = replace(loop(), frame=Frame(values=(("pi.k", 30.0),)))
    found = sufficient_step(model, experiment, {}, share=0.01, halvings=6)
    assert found is not None and found <= 0.025
    moved = step_convergence(model, replace(experiment, step_size=found), {})
    assert moved["plant.y"].relative <= 0.01
    assert sufficient_step(model, experiment, {}, share=0.01, halvings=0) is None
