from dataclasses import replace

import pytest

from falsifier.core.model import Interface, ModelInfo
from falsifier.problem.defaults import default_interface, default_interval

INFO = ModelInfo("m")


@pytest.mark.parametrize(
    ("offered", "chosen"),
    [
        (("model-exchange", "co-simulation"), "co-simulation"),
        (("model-exchange",), "model-exchange"),
        ((), None),
    ],
)
def test_co_simulation_goes_first(offered: tuple[Interface, ...], chosen: str | None) -> None:
    assert default_interface(replace(INFO, interfaces=offered)) == chosen


@pytest.mark.parametrize(
    ("step", "stop", "interval"),
    [
        (0.01, 10.0, 0.01),
        (1 / 30, 15.0, 1 / 30),  # divides it but for rounding
        (0.03, 10.0, 0.01),  # does not divide it
        (20.0, 10.0, 0.01),  # longer than the simulation
        (None, 50.0, 0.05),
        (0.0, 50.0, 0.05),
    ],
)
def test_the_fmus_step_is_taken_where_it_divides_the_stop_time(
    step: float | None, stop: float, interval: float
) -> None:
    assert default_interval(replace(INFO, step_size=step), stop) == pytest.approx(interval)
