"""Levitated ball under its sampled neural controller, many runs at once."""

import numpy as np

from tests.systems.independent.stepping import Array, runge_kutta
from tests.systems.independent.tables import tables

PERIOD = 0.01
LOWEST, HIGHEST = 0.0012713472471279201, 3.9954019738068034
WEAKEST, STRONGEST = -0.97682887932966278, 3.9954019738068034
F_GAIN, F_BIAS = 0.99216750753278893, 0.90790507647934138
G_GAIN, G_BIAS = 4.1169382628446888e-4 * 0.59967978592905768 * -0.86130216008060445, 0.86367766980749950


def positions(references: Array) -> tuple[Array, Array]:
    """Positions and predictions at the controller's samples.

    Args:
        references: Ref at every sample of the controller, shape (samples, runs).

    Returns:
        Position and predicted position, shape (samples, runs) each.
    """
    weights = tables("NN")
    samples, runs = references.shape
    state = np.array([np.full(runs, 0.5), np.zeros(runs)])
    position, prediction = np.empty((2, samples, runs))
    y_before, u_before, u_before_that = np.zeros((3, runs))
    for k in range(samples):
        y = 2 * (state[0] - LOWEST) / (HIGHEST - LOWEST) - 1
        wanted = 2 * (references[k] - LOWEST) / (HIGHEST - LOWEST) - 1
        regressor = np.array([y, y_before, u_before, u_before_that])

        def layer(name: str, x: Array = regressor) -> Array:
            units = np.tanh(weights[f"{name}In"] @ x + weights[f"{name}Offset"][:, None])
            return np.asarray(weights[f"{name}Out"] @ units)

        f = F_GAIN * (layer("f") + F_BIAS)
        g = G_GAIN * (layer("g") + G_BIAS)
        current = np.clip(((wanted - f) / g + 1) / 2 * (STRONGEST - WEAKEST) + WEAKEST, -1, 4)
        position[k], prediction[k] = state[0], f + g * current
        y_before = y
        u_before_that = u_before
        u_before = 2 * (current - WEAKEST) / (STRONGEST - WEAKEST) - 1
        pull = 15 / 3 * np.sign(current) * current**2

        def slope(x: Array, pull: Array = pull) -> Array:
            return np.array([x[1], pull / x[0] - 9.8 - 12 / 3 * x[1]])

        state = runge_kutta(slope, state, PERIOD, 10)
    return position, prediction
