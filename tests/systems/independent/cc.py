"""Chasing cars by closed-form motion between events, each event found by bisection of the exact gap."""

import numpy as np
from numba import njit

from tests.systems.independent.stepping import Array

KEEPING, CHASING, BRAKING = 0, 1, 2


def drive(throttle: Array, brake: Array, step: float) -> tuple[Array, Array]:
    """Positions and modes on the grid of the inputs.

    Args:
        throttle: held over each step of the grid, shape (samples,).
        brake: likewise.
        step: of the grid in s.

    Returns:
        Positions of the five cars, shape (samples, 5), and modes of cars 2 to 5, shape (samples, 4).
    """
    positions, modes = _drive(np.asarray(throttle, float), np.asarray(brake, float), step)
    return positions, modes


@njit(cache=True)
def _moved(y, v, mode, throttle, brake, t):  # type: ignore[no-untyped-def]
    """Positions and velocities after t seconds without an event."""
    y_new, v_new = y.copy(), v.copy()
    damped = brake * t
    if damped < 1e-4:
        reach = t * (1 - damped / 2 + damped**2 / 6)
        travel = t**2 * (0.5 - damped / 6 + damped**2 / 24)
    else:
        reach = -np.expm1(-damped) / brake
        travel = (t - reach) / brake
    v_new[0] = v[0] * np.exp(-damped) - throttle * reach
    y_new[0] = y[0] + v[0] * reach - throttle * travel
    for i in range(1, 5):
        if mode[i - 1] == KEEPING:
            y_new[i] = y[i] + v[i] * t
        elif mode[i - 1] == CHASING:
            v_new[i] = v[i] + t
            y_new[i] = y[i] - v[i] * t - t**2 / 2
        else:
            v_new[i] = v[i] * np.exp(-t)
            y_new[i] = y[i] + v[i] * np.expm1(-t)
    return y_new, v_new


@njit(cache=True)
def _next_modes(y, mode):  # type: ignore[no-untyped-def]
    """Modes that follow from the gaps."""
    new = mode.copy()
    for i in range(4):
        gap = y[i + 1] - y[i]
        if (mode[i] == KEEPING and gap >= 15) or (mode[i] == BRAKING and gap >= 20):
            new[i] = CHASING
        elif mode[i] == KEEPING and gap <= 5:
            new[i] = BRAKING
        elif mode[i] == CHASING and gap <= 10:
            new[i] = KEEPING
    return new


@njit(cache=True)
def _drive(throttle, brake, step):  # type: ignore[no-untyped-def]
    samples = len(throttle)
    y = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    v = np.zeros(5)
    mode = np.zeros(4, dtype=np.int64)
    positions, modes = np.empty((samples, 5)), np.empty((samples, 4))
    for k in range(samples):
        positions[k], modes[k] = y, mode
        left = step
        while left > 0:
            y_end, v_end = _moved(y, v, mode, throttle[k], brake[k], left)
            early, late = 0.0, left
            if not np.array_equal(_next_modes(y_end, mode), mode):
                for _ in range(45):
                    middle = (early + late) / 2
                    y_middle, _v = _moved(y, v, mode, throttle[k], brake[k], middle)
                    if np.array_equal(_next_modes(y_middle, mode), mode):
                        early = middle
                    else:
                        late = middle
                y_end, v_end = _moved(y, v, mode, throttle[k], brake[k], late)
            y, v = y_end, v_end
            mode = _next_modes(y, mode)
            left -= late
    return positions, modes
