"""A component's solver starts each simulation from nothing, with the lines that its inputs follow."""

import pytest

from falsifier.core.signals import Signal
from tests.fmu.small_systems import run, solved, system


def test_a_simulation_does_not_depend_on_the_one_before() -> None:
    """The second one has other pieces, and ended in other states, events and steps."""
    model = system({"ball": solved("Ball_2"), "ticker": solved("Ticker_3")}, {"ticker.u": "ball.h"})
    lag = system({"lag": solved("Lag_3")}, {})
    first = run(model, "ball.h", "ticker.count", "ticker.x", stop=2.0)
    run(
        model,
        "ball.h",
        "ticker.count",
        "ticker.x",
        stop=2.0,
        parameters={"ball.h": 5.0, "ticker.period": 0.1},
    )
    again = run(model, "ball.h", "ticker.count", "ticker.x", stop=2.0)
    for name in first.names:
        assert again[name].tolist() == first[name].tolist()
    step, flat = Signal((0.0, 0.5), (1.0, 4.0), "constant"), Signal((0.0,), (1.0,))
    ends = [run(lag, "lag.x", signals={"lag.u": u})["lag.x"][-1] for u in (flat, step, flat)]
    assert ends[0] == pytest.approx(ends[2]) and ends[1] > ends[0] + 0.5
