import pytest

from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from tests.fmu.fixtures import ME, isolated, ramp, run
from tests.fmu.support import DISCARD, END, ERROR


def test_parameters_that_do_not_fit_are_refused_before_the_simulation() -> None:
    with pytest.raises(SimulationError, match=r"'misdeed'") as caught:
        run(isolated("Misdeeds_2"), ("y",), parameters={"misdeed": 1e12})
    assert caught.value.time == 0.0


def test_where_an_input_is_driven_its_range_is_looked_at_over_the_whole_time() -> None:
    signal = Signal((0.0, 0.5, 0.7), (0.0, 300.0, 0.0), "constant")
    with pytest.raises(SimulationError, match=r"from 0 to 300 .*'in_UInt8'"):
        run(isolated("Echo_3"), ("out_UInt8",), signals={"in_UInt8": signal})


@pytest.mark.parametrize(("misdeed", "says"), [(ERROR, "error"), (DISCARD, "discard"), (END, "discard")])
def test_a_step_that_fails_is_told_with_its_time(misdeed: int, says: str) -> None:
    with pytest.raises(SimulationError, match=rf"the step returned {says} at t = 0\.5 s.*1 s") as caught:
        run(isolated("Misdeeds_2"), ("y",), parameters={"misdeed": misdeed})
    assert caught.value.time == pytest.approx(0.5)


def test_an_fmu_that_ends_the_simulation_early_is_told_with_its_time() -> None:
    with pytest.raises(SimulationError, match=r"terminated the simulation at t = 0\.6 s"):
        run(isolated("Misdeeds_3"), ("y",), parameters={"misdeed": END})


@pytest.mark.parametrize("interface", ["co-simulation", ME])
def test_the_first_sample_is_that_of_time_zero(interface: str) -> None:
    got = run(isolated("Lag_2", interface), ("x", "y"), signals={"u": ramp(1.0)}, parameters={"x": 4.0})  # type: ignore[arg-type]
    assert (got["x"][0], got["y"][0]) == (4.0, 4.0)
