import numpy as np
import pytest

from falsifier.engines.surrogate.dynamics import DeviationDynamics, FourierDynamics, StartState, Traces
from falsifier.testing import FREE, START, lag_problem
from tests.engines.surrogate.support import SETTINGS, history_of


@pytest.mark.parametrize("dynamics", [FourierDynamics, DeviationDynamics])
def test_dynamics_predict_an_unseen_input_from_a_few_trajectories(
    dynamics: type[FourierDynamics] | type[DeviationDynamics],
) -> None:
    history = history_of(lag_problem(free=FREE, inputs=2, parameters=[START]), simulations=12)
    traces = [s.trace for s in history.samples]
    known = Traces.of(traces[:-2])
    fitted = dynamics(known, [0, 1, 2], SETTINGS, np.random.default_rng(0))
    start = StartState(known.states[:, 0], known.inputs[:, 0])
    for trace in traces[-2:]:
        inputs = trace.inputs[None, :50]
        predicted = fitted.predict(inputs, start.predict(inputs)).states[0, :, 0]
        true = trace.states[:51, 0]
        assert np.abs(predicted - true).max() < 0.25 * np.ptp(true)
