"""Co-simulation of the test FMUs against what the models are by their equations."""

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.model import Interface
from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from tests.fmu.fixtures import ME, isolated, ramp, run

LAGS = ["Lag_1cs", "Lag_2", "Lag_3"]
Floats = NDArray[np.float64]


def held_lag(values: Floats, step: float) -> Floats:
    """x' = (u - x) / 2 with u held over each step: the exact solution at the step ends."""
    x, decay, found = 0.0, float(np.exp(-step / 2.0)), [0.0]
    for u in values:
        x = u + (x - u) * decay
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("name", LAGS)
def test_inputs_of_a_communication_point_hold_until_the_next(name: str) -> None:
    wave = Signal.evenly((0.0, 3.0, -2.0, 5.0), stop_time=2.0)
    got = run(isolated(name), ("x", "y"), stop=2.0, signals={"u": wave}, parameters={"gain": 3.0})
    expected = held_lag(wave.sample(np.linspace(0.0, 1.9, 20)), 0.1)
    np.testing.assert_allclose(got["x"], expected, atol=1e-9)
    np.testing.assert_allclose(got["y"], 3.0 * expected, atol=1e-9)
    assert len(got) == 21 and got.units == {"x": "m", "y": "m"}


@pytest.mark.parametrize("name", LAGS)
def test_a_smaller_communication_step_keeps_the_output_grid(name: str) -> None:
    got = run(isolated(name), ("x",), signals={"u": ramp(1.0)}, step_size=0.02)
    expected = held_lag(np.linspace(0.0, 0.98, 50), 0.02)[::5]
    np.testing.assert_allclose(got["x"], expected, atol=1e-9)


@pytest.mark.parametrize("name", ["Echo_1", "Echo_2", "Echo_3"])
def test_every_type_goes_in_rounded_and_comes_out(name: str) -> None:
    model = isolated(name)
    model.close()
    inputs = {v.name: ramp(1.0, 3.0 if v.kind != "boolean" else 1.0) for v in model.info.inputs}
    got = run(model, [v.name for v in model.info.outputs], signals=inputs)
    points = np.arange(10) * 0.1
    for variable in model.info.outputs:
        raw = 3.0 * points
        expected = {
            "real": raw.astype(np.float32) if "32" in variable.name else raw,
            "boolean": (points >= 0.5).astype(float),
        }.get(variable.kind, np.rint(raw))
        np.testing.assert_allclose(got[variable.name][1:], expected, err_msg=variable.name)


def test_elements_of_arrays_are_driven_set_and_recorded_alone() -> None:
    # x1' = x2 + u1, x2' = -x1: with u1 = 1 held from rest x1 = sin t, x2 = cos t - 1.
    got = run(isolated("Arrays_3"), ("y[2]", "x[1]"), signals={"u[1]": Signal((0.0,), (1.0,))}, interval=0.01)
    np.testing.assert_allclose(got["x[1]"], np.sin(got.times), atol=1e-9)
    np.testing.assert_allclose(got["y[2]"], np.cos(got.times) - 1 + 20.0, atol=1e-9)
    got = run(isolated("Arrays_3"), ("y[1]", "y[2]", "A[2,1]"), parameters={"offset[2]": 5.0, "A[2,1]": 0.0})
    assert (got["y[1]"][-1], got["y[2]"][-1], got["A[2,1]"][-1]) == (10.0, 5.0, 0.0)


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
def test_a_fixed_element_stays_if_another_one_is_driven(interface: Interface) -> None:
    # x1' = x2 + u1, x2' = -x1 + u2 from rest: with u = (1, 2), x1 = sin t + 2 (1 - cos t).
    model = isolated("Arrays_3", interface)
    drive = {"u[1]": Signal((0.0,), (1.0,))}
    for fixed in (2.0, -1.0):
        got = run(model, ("x[1]",), signals=drive, parameters={"u[2]": fixed}, interval=0.01)
        exact = np.sin(got.times) + fixed * (1.0 - np.cos(got.times))
        np.testing.assert_allclose(got["x[1]"], exact, atol=1e-6)
    got = run(model, ("x[1]",), signals=drive, interval=0.01)
    np.testing.assert_allclose(got["x[1]"], np.sin(got.times), atol=1e-6)


def test_event_mode_sets_discrete_inputs_at_events() -> None:
    step = Signal((0.0, 0.5), (1.0, 3.0), "constant")
    got = run(isolated("Echo_3"), ("out_Int32",), signals={"in_Int32": step})
    assert got["out_Int32"].tolist() == [1, 1, 1, 1, 1, 1, 3, 3, 3, 3, 3]


@pytest.mark.parametrize("name", ["Ball_2", "Ball_3"])
def test_events_inside_of_steps(name: str) -> None:
    """The first bounce is at t = sqrt(2 h / g) = 0.4515 s, whether or not the FMU returns early for it."""
    got = run(isolated(name), ("h", "v", "bounces"), interval=0.05)
    assert got["bounces"][got.index(0.45)] == 0 and got["bounces"][got.index(0.5)] == 1
    flight = 0.5 - np.sqrt(2 / 9.81)
    assert got["v"][got.index(0.5)] == pytest.approx(0.7 * np.sqrt(2 * 9.81) - 9.81 * flight, abs=0.12)


def test_parameters_that_do_not_fit_are_refused_before_the_simulation() -> None:
    with pytest.raises(SimulationError, match=r"'misdeed'") as caught:
        run(isolated("Misdeeds_2"), ("y",), parameters={"misdeed": 2.0**31})
    assert caught.value.time == 0.0
    assert "from 2147483648 to 2147483648" in str(caught.value) and "2147483647" in str(caught.value)


def test_where_an_input_is_driven_its_range_is_looked_at_over_the_whole_time() -> None:
    signal = Signal((0.0, 0.5, 0.7), (0.0, 300.0, 0.0), "constant")
    with pytest.raises(SimulationError, match=r"from 0 to 300 .*'in_UInt8'"):
        run(isolated("Echo_3"), ("out_UInt8",), signals={"in_UInt8": signal})


@pytest.mark.parametrize("interface", ["co-simulation", ME])
def test_the_first_sample_is_that_of_time_zero(interface: str) -> None:
    got = run(isolated("Lag_2", interface), ("x", "y"), signals={"u": ramp(1.0)}, parameters={"x": 4.0})  # type: ignore[arg-type]
    assert (got["x"][0], got["y"][0]) == (4.0, 4.0)
