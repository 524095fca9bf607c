import numpy as np
import pytest

from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.ports import make_ports
from falsifier.fmu.stepper import check_range
from tests.fmu import fixtures
from tests.fmu.fixtures import ME, isolated, ramp, run
from tests.fmu.support import DISCARD, END, ERROR

ECHO = read_description(fixtures.path("Echo_3"))


@pytest.mark.parametrize(
    ("name", "row", "fits"),
    [
        ("in_Int8", [-128.4, 127.4], True),
        ("in_Int8", [-129.0, 0.0], False),
        ("in_UInt8", [0.0, 256.0], False),
        ("in_UInt8", [-0.4, 255.0], True),  # is rounded
        ("in_Boolean", [0.0, 1.0], True),
        ("in_Float64", [-1e300, 1e300], True),
    ],
)
def test_values_must_fit_the_type_of_their_variable(name: str, row: list[float], fits: bool) -> None:
    ports = make_ports(ECHO, [name], {ECHO.slots[name].type: 1})
    rows = np.array([row])
    if fits:
        check_range("Echo", [name], ports, rows)
    else:
        with pytest.raises(SimulationError, match=f"Echo: .*'{name}'"):
            check_range("Echo", [name], ports, rows)


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
