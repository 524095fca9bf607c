import numpy as np
import pytest

from falsifier.fmu.solver_memory import make_memory


@pytest.mark.parametrize(("states", "indicators"), [(0, 0), (3, 2)])
def test_a_run_begins_at_time_zero_without_events(states: int, indicators: int) -> None:
    memory = make_memory(states, indicators, 1)
    assert memory.clock.tolist() == [0.0, 0.0, np.inf]
    assert not memory.counts.any()
    assert (memory.x.shape, memory.stages.shape) == ((states,), (7, states))
    assert (memory.z.shape, memory.trials.shape) == ((indicators,), (3, indicators))
