"""The solver of model-exchange FMUs against closed forms and scipy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from falsifier.errors import SimulationError
from tests.fmu.fixtures import ME, isolated, run

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


def test_tighter_tolerances_are_more_exact() -> None:
    def error(tolerance: float) -> float:
        got = run(
            isolated("Arrays_3", ME),
            ("x[1]",),
            stop=20.0,
            interval=2.0,
            parameters={"x[1]": 1.0},
            tolerance=tolerance,
        )
        return float(np.abs(got["x[1]"] - np.cos(got.times)).max())

    assert error(1e-9) < 1e-7 < error(1e-3) < 1e-1


def test_events_that_pile_up_are_an_error() -> None:
    with pytest.raises(SimulationError, match="its events never end at t = "):
        run(isolated("Ticker_2", ME), ("x",), parameters={"period": 1e-9})
