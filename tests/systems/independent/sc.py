"""Steam condenser under its recurrent controller, many runs at once."""

import numpy as np

from tests.systems.independent.stepping import Array, runge_kutta
from tests.systems.independent.tables import tables


def outputs(steam: Array, step: float) -> dict[str, Array]:
    """Outputs by name on the grid of the input, shape (samples, runs) each.

    Args:
        steam: steam flow, held over each step of the grid, shape (samples, runs).
        step: of the grid in s.
    """
    data = tables("SC")
    to_network = np.hstack([data["weight1"], data["weight2"]])

    def continued(table: str, x: Array) -> Array:
        at, values = data["steamPressure"], data[table]
        piece = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
        share = (x - at[piece]) / (at[piece + 1] - at[piece])
        return np.asarray((1 - share) * values[piece] + share * values[piece + 1])

    def heat(water: Array, pressure: Array, flow: Array) -> Array:
        steam_side = continued("condensingTemperature", pressure)
        mean_difference = (water - 60) / (np.log(steam_side - 60) - np.log(steam_side - water))
        return np.asarray(mean_difference / (0.0872924756541668 * flow**-0.8 + 0.00073786772008033))

    def slope(x: Array, inflow: Array, set_point: float) -> Array:
        water, pressure, flow, measured = x[:4]
        filters = x[4:]
        span = 5.7997431225043385 + 3.7742393716738434
        error = 2 * (measured - set_point + 3.7742393716738434) / span - 1
        units = np.tanh(data["offset"][:, None] + data["inputWeight"][:, None] * error + to_network @ filters)
        network = data["outputWeight"] @ units - 0.33227866684137108
        command = (network + 1) / 2 * (66.879264965962932 + 30.855068745036114) - 30.855068745036114
        q = heat(water, pressure, flow)
        condensed = q / continued("condensationHeat", pressure)
        return np.vstack(
            [
                (q / 4.2 + flow * (60 - water)) / 500,
                0.461526 / 3 * continued("condensingTemperature", pressure) * (inflow - condensed),
                np.clip(107.8880952381 + command, 0, 200) - flow,
                2 * (pressure - measured),
                units - 10 * filters[:3],
                filters[:3] - 10 * filters[3:],
            ]
        )

    samples, runs = steam.shape
    state = np.zeros((10, runs))
    state[:4] = np.array([80, 90, 107.8880952381, 90])[:, None]
    rows = np.empty((samples, 10, runs))
    for k in range(samples):
        rows[k] = state
        inflow, set_point = steam[k], 90.0 if (k + 0.5) * step < 2 else 87.0

        def held(x: Array, inflow: Array = inflow, set_point: float = set_point) -> Array:
            return slope(x, inflow, set_point)

        state = runge_kutta(held, state, step, 1)
    return {
        "T": rows[:, 0],
        "Fcw": rows[:, 2],
        "Q": heat(rows[:, 0], rows[:, 1], rows[:, 2]),
        "pressure": rows[:, 3],
    }
