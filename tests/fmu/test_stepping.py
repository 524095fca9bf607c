"""The compiled loops against the same loops in plain Python."""

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.signals import Signal
from falsifier.fmu import stepper
from tests.fmu import plain
from tests.fmu.fixtures import isolated, run

OUTPUTS = {
    **{name: ("x", "y") for name in ("Lag_1cs", "Lag_2", "Lag_3")},
    **{name: ("h", "v", "bounces") for name in ("Ball_2", "Ball_3")},
    **{name: ("sampled", "count", "x") for name in ("Ticker_2", "Ticker_3")},
    "Arrays_3": ("x[2]", "y[1]", "A[1,2]"),
    "VanDerPol_3": ("x", "v"),
}
Floats = NDArray[np.float64]


@pytest.mark.parametrize("name", sorted(OUTPUTS))
def test_plain_loops_do_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model = isolated(name)
    inputs = {v.name: Signal.evenly((0.0, 2.0, -1.0, 1.0), stop_time=2.0) for v in model.info.inputs}

    def outcome() -> Floats:
        model.close()
        got = run(model, OUTPUTS[name], stop=2.0, interval=0.05, signals=inputs, step_size=0.01)
        return np.stack([got[n] for n in got.names])

    compiled = outcome()
    monkeypatch.setattr(stepper, "loops", lambda: plain)
    np.testing.assert_array_equal(outcome(), compiled)
