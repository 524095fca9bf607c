"""Abstract fuel control in short equal steps: pressure by backward differences, lags in closed form.

The pressure p is computed as 1 - w^2, because the flow through the throttle is smooth in w near p = 1.
"""

import numpy as np
from numba import njit

from tests.systems.independent.stepping import Array
from tests.systems.independent.tables import tables

TICK = 0.01
SUBSTEPS = 20


def ratios(pedal: Array, engine: Array) -> tuple[Array, Array, Array]:
    """Return relative error of the air/fuel ratio, mode and pressure at the controller's samples.

    Args:
        pedal: pedal angle in deg, held from each sample to the next, shape (samples,).
        engine: engine speed in rev/min, shape (samples,).
    """
    data = tables("AFC")
    maps = [data[name] for name in ("delaySpeed", "delayAir", "delayTable")]
    maps += [data[name] for name in ("wallSpeed", "wallAir", "directTable", "dryingTable")]
    mu, mode, pressure = _run(np.asarray(pedal, float), np.asarray(engine, float), *maps)
    return mu, mode, pressure


@njit(cache=True)
def _look_up(table, rows, columns, r, c):  # type: ignore[no-untyped-def]
    i = min(max(np.searchsorted(rows, r, side="right") - 1, 0), len(rows) - 2)
    j = min(max(np.searchsorted(columns, c, side="right") - 1, 0), len(columns) - 2)
    up = (r - rows[i]) / (rows[i + 1] - rows[i])
    along = (c - columns[j]) / (columns[j + 1] - columns[j])
    low = (1 - along) * table[i, j] + along * table[i, j + 1]
    high = (1 - along) * table[i + 1, j] + along * table[i + 1, j + 1]
    return (1 - up) * low + up * high


@njit(cache=True)
def _swallowed(p, turning):  # type: ignore[no-untyped-def]
    return -0.366 + turning * p * (0.08979 - 0.0337 * p + 0.0001 * turning)


@njit(cache=True)
def _breathed(lag, p):  # type: ignore[no-untyped-def]
    x = min(max(lag + 8.8, 0.0), 90.0)
    full = 2.821 - 0.05231 * x + 0.10299 * x * x - 0.00063 * x * x * x
    return full * (1.0 if p < 0.5 else 2 * np.sqrt(p * (1 - p)))


@njit(cache=True)
def _next_pressure(known, share, lag, turning, guess):  # type: ignore[no-untyped-def]
    """Solve p = known + share * p' by Newton's method for w = sqrt(1 - p)."""
    w = np.sqrt(max(1 - guess, 1e-12))
    for _ in range(60):
        tiny = 1e-7
        f = 1 - w * w - known - share * _rate(lag, w, turning)
        g = 1 - (w + tiny) ** 2 - known - share * _rate(lag, w + tiny, turning)
        step = f * tiny / (g - f)
        w = max(w - step, 0.1 * w)
        if abs(step) < 1e-13:
            break
    return 1 - w * w


@njit(cache=True)
def _rate(lag, w, turning):  # type: ignore[no-untyped-def]
    p = 1 - w * w
    return 0.41328 * (_breathed(lag, p) - 0.9 * _swallowed(p, turning))


@njit(cache=True)
def _lagged(y, rate, u0, u1, h):  # type: ignore[no-untyped-def]
    """Return a first-order lag after h seconds, while its input changes linearly from u0 to u1."""
    slope = (u1 - u0) / h
    return u1 - slope / rate + (y - u0 + slope / rate) * np.exp(-rate * h)


@njit(cache=True)
def _run(pedal, engine, delay_n, delay_c, delay, wall_n, wall_c, direct, drying):  # type: ignore[no-untyped-def]
    samples, h = len(pedal), TICK / SUBSTEPS
    mu, modes, pressures = np.zeros(samples), np.ones(samples), np.empty(samples)
    # Gas in the exhaust pipe: distance travelled and ratios at both ends of each step.
    way = np.zeros(samples * SUBSTEPS + 1)
    left, right = np.full(len(way), 14.7), np.full(len(way), 14.7)
    lag, film, mixed, measured, p, p_before = 0.0, 0.0112, 14.7, 14.7, 0.982, 0.982
    fuel, reference, mode, power, guess, total, trim = 0.1726, 14.7, 1, False, 0.982, 0.0, 0.0
    arrived, oldest = 14.7, 0
    for k in range(samples):
        n = min(max(engine[k], 900.0), 1100.0)
        turning = np.pi * n / 30
        if k > 0:
            opening = min(max(lag + 8.8, 0.0), 90.0)
            power = opening >= 50 if power else opening >= 70
            mode = 1 if power or k < 1000 else 0
            reference = 12.5 if power and k >= 1000 else 14.7
            expected = _swallowed(guess, turning)
            guess += 0.41328 * TICK * (_breathed(lag, p) - expected)
            if mode == 0:
                total += 0.14 * TICK * (measured - reference)
                trim = 0.04 * (measured - reference) + total
            fuel = expected / reference * (1.0 if mode == 1 else max(0.0, 1 + trim))
            fuel = min(max(fuel, 0.13), 1.66)
        modes[k], pressures[k] = mode, p
        mu[k] = measured / reference - 1 if k >= 100 else 0.0
        for s in range(SUBSTEPS):
            i = k * SUBSTEPS + s
            air = 0.9 * _swallowed(p, turning)
            lag_new = pedal[k] + (lag - pedal[k]) * np.exp(-10 * h)
            if i == 0:
                p_new = _next_pressure(p, h, lag_new, turning, p)
            else:
                p_new = _next_pressure((4 * p - p_before) / 3, 2 * h / 3, lag_new, turning, p)
            air_new = 0.9 * _swallowed(p_new, turning)
            c, c_new = np.pi * air / turning, np.pi * air_new / turning
            a = _look_up(direct, wall_n, wall_c, n, c)
            a_new = _look_up(direct, wall_n, wall_c, n, c_new)
            t = _look_up(drying, wall_n, wall_c, n, c)
            t_new = _look_up(drying, wall_n, wall_c, n, c_new)
            film_new = film + h / 2 * ((2 - a - a_new) * fuel - film / t)
            film_new /= 1 + h / 2 / t_new
            right[i] = air / (a * fuel + film / t)
            left[i + 1] = air_new / (a_new * fuel + film_new / t_new)
            speed = 1 / _look_up(delay, delay_n, delay_c, n, c)
            speed_new = 1 / _look_up(delay, delay_n, delay_c, n, c_new)
            way[i + 1] = way[i] + h / 2 * (speed + speed_new)
            come = way[i + 1] - 1
            arriving = 14.7
            if come >= 0:
                while way[oldest + 1] <= come:
                    oldest += 1
                part = (come - way[oldest]) / (way[oldest + 1] - way[oldest])
                arriving = right[oldest] + part * (left[oldest + 1] - right[oldest])
            mixed_new = _lagged(mixed, 10.0, arrived, arriving, h)
            measured = _lagged(measured, 50.0, mixed, mixed_new, h)
            p_before, p, lag, film, mixed, arrived = p, p_new, lag_new, film_new, mixed_new, arriving
    return mu, modes, pressures
