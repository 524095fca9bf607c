"""Model exchange of the test FMUs against closed forms, scipy and co-simulation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from tests.fmu.fixtures import ME, isolated, ramp, run, runner

LAGS = ["Lag_1me", "Lag_2", "Lag_3"]
TICKERS = ["Ticker_1me", "Ticker_2", "Ticker_3"]


@pytest.mark.parametrize("name", LAGS)
def test_inputs_act_inside_of_steps(name: str) -> None:
    """With u = t: x = t - T + T exp(-t / T), however far apart the outputs are."""
    for interval in (0.01, 0.5):
        got = run(isolated(name, ME), ("x",), stop=5.0, interval=interval, signals={"u": ramp(5.0)})
        exact = got.times - 2.0 + 2.0 * np.exp(-got.times / 2.0)
        np.testing.assert_allclose(got["x"], exact, atol=3e-7)


@pytest.mark.parametrize("interpolation", ["pchip", "linear", "constant"])
@pytest.mark.parametrize("hold", [None, 0.3])
def test_any_signal_is_followed(interpolation: str, hold: float | None) -> None:
    signal = Signal((0.0, 0.7, 1.1, 3.0), (0.0, 2.0, -1.0, 1.0), interpolation, hold)  # type: ignore[arg-type]
    got = run(isolated("Lag_2", ME), ("x",), stop=4.0, signals={"u": signal}, parameters={"T": 0.5})
    fine = np.linspace(0.0, 4.0, 400_001)
    middle = signal.sample((fine[1:] + fine[:-1]) / 2)
    x, expected = 0.0, [0.0]
    decay = float(np.exp(-1e-5 / 0.5))
    for k, u in enumerate(middle.tolist(), start=1):
        x = u + (x - u) * decay
        if k % 10_000 == 0:
            expected.append(x)
    np.testing.assert_allclose(got["x"], expected, atol=2e-5)


@pytest.mark.parametrize("name", TICKERS)
def test_time_events_are_met_exactly(name: str) -> None:
    """The sample of u = t at each multiple of 0.5 s is held; x integrates it."""
    got = run(
        isolated(name, ME), ("sampled", "count", "x"), stop=3.0, interval=0.05, signals={"u": ramp(3.0)}
    )
    ticks = np.floor(got.times / 0.5 + 1e-9)
    np.testing.assert_allclose(got["sampled"], 0.5 * ticks, atol=1e-9)
    assert got["count"].tolist() == (ticks + 1).tolist()
    exact = 0.25 * ticks * (ticks - 1) / 2 + 0.5 * ticks * (got.times - 0.5 * ticks)
    np.testing.assert_allclose(got["x"], exact, atol=1e-9)


@pytest.mark.parametrize("name", ["Strict_2", "Strict_3"])
def test_new_nominal_values_are_asked_for_after_events_and_sizes_only_before_the_simulation(
    name: str,
) -> None:
    model = isolated(name, ME)
    for outputs in (("count",), ("count", "x")):
        assert run(model, outputs, stop=3.0)["count"][-1] == 7.0
    assert not runner(model)._repeats


def test_discrete_inputs_change_at_events_only() -> None:
    """Ticker samples u, a continuous input; driven by a step it sees the value after the step."""
    step = Signal((0.0, 0.5), (1.0, 3.0), "constant")
    got = run(isolated("Ticker_2", ME), ("sampled",), signals={"u": step})
    assert got["sampled"].tolist() == [1.0] * 5 + [3.0] * 6


def test_a_model_that_leaves_its_domain_fails_with_the_time() -> None:
    """Van der Pol's equation run with negative damping of the far field blows up in finite time."""
    with pytest.raises(SimulationError, match=r"no step is small enough.* at t = "):
        run(isolated("VanDerPol_2", ME), ("x",), stop=50.0, parameters={"mu": -1.0, "x": 5.0})


@pytest.mark.parametrize("name", LAGS)
def test_derivatives_that_are_not_finite_at_the_start_are_told(name: str) -> None:
    with pytest.raises(SimulationError, match=r"the derivatives are NaN, .* at t = 0 s, before .* 1 s$"):
        run(isolated(name, ME), ("x",), parameters={"T": 0.0})


BALLS = ["Ball_1me", "Ball_2", "Ball_3"]


def ball(time: float, *, g: float = 9.81, e: float = 0.7) -> tuple[float, float, int]:
    """Height, velocity and bounces of the ball, flight by flight."""
    height, speed, start, bounces = 1.0, 0.0, 0.0, 0
    while True:
        flight = (speed + np.sqrt(speed**2 + 2 * g * height)) / g
        if start + flight > time:
            rest = time - start
            return height + speed * rest - g / 2 * rest**2, speed - g * rest, bounces
        start, speed, height, bounces = start + flight, e * (g * flight - speed), 0.0, bounces + 1


@pytest.mark.parametrize("name", BALLS)
def test_state_events_are_located(name: str) -> None:
    got = run(isolated(name, ME), ("h", "v", "bounces"), stop=2.0, interval=0.01, parameters={"e": 0.8})
    exact = np.array([ball(t, e=0.8) for t in got.times])
    np.testing.assert_allclose(got["h"], exact[:, 0], atol=1e-8)
    np.testing.assert_allclose(got["v"], exact[:, 1], atol=1e-8)
    assert got["bounces"].tolist() == exact[:, 2].tolist()


@pytest.mark.parametrize("name", ["Floor_2", "Floor_3"])
def test_a_step_to_where_event_indicators_are_undefined_is_shortened(name: str) -> None:
    """The first step, of 0.7 s, would end 1.4 m below the floor."""
    got = run(isolated(name, ME), ("h",), stop=1.4, interval=0.7, parameters={"e": 0.8})
    np.testing.assert_allclose(got["h"], [ball(t, e=0.8)[0] for t in got.times], atol=1e-8)


def test_stiff_models_are_solved() -> None:
    """x' = -1e6 (x - cos t) - sin t: an explicit method would need three million steps."""
    got = run(isolated("Stiff_2", ME), ("x",), stop=10.0, interval=0.05)
    np.testing.assert_allclose(got["x"], np.cos(got.times), atol=1e-7)


@pytest.mark.parametrize(("mu", "stop"), [(1.0, 10.0), (100.0, 100.0)])
def test_van_der_pol_agrees_with_scipy(mu: float, stop: float) -> None:
    got = run(
        isolated("VanDerPol_2", ME),
        ("x", "v"),
        stop=stop,
        interval=stop / 200,
        parameters={"mu": mu},
        tolerance=1e-8,
    )
    exact = solve_ivp(
        lambda t, z: [z[1], mu * (1 - z[0] ** 2) * z[1] - z[0]],
        (0, stop), [2.0, 0.0], method="Radau", rtol=1e-10, atol=1e-12, t_eval=got.times,
    )  # fmt: skip
    np.testing.assert_allclose(got["x"], exact.y[0], atol=1e-4)


def test_events_that_pile_up_are_an_error() -> None:
    with pytest.raises(SimulationError, match="its events never end at t = "):
        run(isolated("Ticker_2", ME), ("x",), parameters={"period": 1e-9})
