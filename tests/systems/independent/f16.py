"""F-16 under its collision-avoidance autopilot, many runs at once."""

import numpy as np
from numpy.polynomial.polynomial import polyval

from tests.systems.independent.stepping import Array, runge_kutta
from tests.systems.independent.tables import tables

STAND_BY, ROLL, PULL = 0, 1, 2
DEGREE = np.pi / 180
SAMPLES_PER_SECOND = 30
STEPS_PER_SAMPLE = 2
NAMES = ("vt", "alpha", "beta", "phi", "theta", "psi", "p", "q", "r", "pn", "pe", "altitude", "power")


def flights(attitudes: Array, seconds: int = 15) -> dict[str, Array]:
    """States by name and the autopilot's mode at its samples, shape (samples, runs) each.

    Args:
        attitudes: roll, pitch and yaw at the start in rad, shape (3, runs).
        seconds: length of the flights.
    """
    runs = attitudes.shape[1]
    state = np.zeros((16, runs))
    state[0], state[1], state[3:6], state[11], state[12] = 540, 2.1215 * DEGREE, attitudes, 2338, 9
    mode = np.full(runs, ROLL)
    pulled = np.zeros(runs, dtype=int)
    samples = seconds * SAMPLES_PER_SECOND + 1
    rows, modes = np.empty((samples, 16, runs)), np.empty((samples, runs))
    for k in range(samples):
        climbing = _nearest_turn(state[4] - state[1]) > 0
        level = (abs(state[6]) < 10 * DEGREE) & (abs(_nearest_turn(state[3])) < 5 * DEGREE)
        to_pull = (mode == ROLL) & level
        to_stand_by = (mode == PULL) & climbing & (k - pulled >= 60)
        to_roll = (mode == STAND_BY) & ~climbing & (state[11] < 1000)
        pulled[to_pull] = k
        mode = np.select([to_pull, to_stand_by, to_roll], [PULL, STAND_BY, ROLL], mode)
        rows[k], modes[k] = state, mode

        def slope(x: Array, mode: Array = mode) -> Array:
            return _slope(x, mode)

        state = runge_kutta(slope, state, 1 / SAMPLES_PER_SECOND, STEPS_PER_SAMPLE)
    return {**{name: rows[:, i] for i, name in enumerate(NAMES)}, "mode": modes}


def _nearest_turn(angle: Array) -> Array:
    return np.asarray(angle - 2 * np.pi * np.rint(angle / (2 * np.pi)))


_AERO = tables("F16Aerodynamics")
_ENGINE = tables("F16Engine")
_DAMPING = np.array([_AERO[k] for k in ("CXq", "CYr", "CYp", "CZq", "Clr", "Clp", "Cmq", "Cnr", "Cnp")])


def _slope(x: Array, mode: Array) -> Array:
    vt, alpha, beta, phi, theta, psi, p, q, r, _, _, altitude, power = x[:13]
    surfaces = _surfaces(x)
    density_factor = 1 - 0.703e-5 * altitude
    sound = np.sqrt(1.4 * 1716.3 * 519 * density_factor)
    pressure_area = 0.5 * 2.377e-3 * density_factor**4.14 * vt**2 * 300
    rates = np.array([p * 30, q * 11.32, r * 30]) / (2 * vt)
    cx, cy, cz, cl, cm, cn = _coefficients(alpha, beta, surfaces, rates)
    push = 1.57e-3 * (pressure_area * cx + _thrust(power, altitude, vt / sound))
    side, lift = 1.57e-3 * pressure_area * cy, 1.57e-3 * pressure_area * cz

    sin_a, cos_a, sin_b, cos_b = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    velocity = vt * np.array([cos_a * cos_b, sin_b, sin_a * cos_b])
    turn = np.array([p, q, r])
    to_body = _rotation(phi, theta, psi)
    gravity = 32.17 * to_body[:, 2]
    du, dv, dw = np.array([push, side, lift]) + gravity - np.cross(turn, velocity, axis=0)
    u, v, w = velocity
    dvt = (u * du + v * dv + w * dw) / vt

    roll, pitch, yaw = pressure_area * np.array([30 * cl, 11.32 * cm, 30 * cn])
    dp = (0.02755 * p - 0.770 * r + 1.642e-6 * 160) * q + 1.055e-4 * roll + 1.642e-6 * yaw
    dq = (0.9604 * p - 1.792e-5 * 160) * r + 1.759e-2 * (r**2 - p**2) + 1.792e-5 * pitch
    dr = (-0.7336 * p - 0.02755 * r + 1.587e-5 * 160) * q + 1.642e-6 * roll + 1.587e-5 * yaw

    load = (15 * dq - lift) / 32.17 - 1
    side_load = (side + 15 * dr) / 32.17
    stability_roll = p * np.cos(alpha - 0.0389) + r * np.sin(alpha - 0.0389)
    wanted_roll = np.where(mode == ROLL, -4 * _nearest_turn(phi) - 2 * p, 0.0)
    north, east, down = np.einsum("ijk,ik->jk", to_body, velocity)
    return np.array(
        [
            dvt,
            (u * dw - w * du) / (u**2 + w**2),
            (vt * dv - v * dvt) * cos_b / (u**2 + w**2),
            p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)),
            q * np.cos(phi) - r * np.sin(phi),
            (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta),
            dp,
            dq,
            dr,
            north,
            east,
            -down,
            64.94 * 0.1395 - power,
            load - np.where(mode == PULL, 5.0, 0.0),
            stability_roll - wanted_roll,
            side_load + r,
        ]
    )


def _surfaces(x: Array) -> Array:
    """Elevator, aileron and rudder in rad, limited."""
    alpha, beta, p, q, r, int_nz, int_ps, int_nyr = x[[1, 2, 6, 7, 8, 13, 14, 15]]
    gains = np.array(
        [
            [156.8801506723475, 0, 0, 31.037008068526642, 0, 38.72983346216317, 0, 0],
            [0, -37.84483, 25.40956, 0, 6.82876, 0, 332.88343, 17.15997],
            [0, 23.91233, -5.69968, 0, 21.63431, 0, -64.49490, 88.36203],
        ]
    )
    command = gains @ np.array([alpha - 0.0389, beta, p, q, r, int_nz, int_ps, int_nyr])
    command[0] -= 0.7496
    limits = np.array([25.0, 21.5, 30.0])[:, None]
    return np.asarray(np.clip(command, -limits, limits) * DEGREE)


def _coefficients(alpha: Array, beta: Array, surfaces: Array, rates: Array) -> tuple[Array, ...]:
    e, a, r = surfaces
    ph, qh, rh = rates
    m = _AERO
    one, a2, a3, b2 = np.ones_like(alpha), alpha**2, alpha**3, beta**2
    at = alpha / DEGREE / 5 + 2
    left = np.clip(np.floor(at).astype(int), 0, 10)
    d = _DAMPING[:, left] + (at - left) * (_DAMPING[:, left + 1] - _DAMPING[:, left])
    cx = m["a"] @ np.array([one, alpha, e**2, e, alpha * e, a2, a3]) + (polyval(alpha, m["b"]) + d[0]) * qh
    cy = (
        m["c"] @ np.array([beta, a, r])
        + (polyval(alpha, m["d"]) + d[2]) * ph
        + (polyval(alpha, m["e"]) + d[1]) * rh
    )
    cz = polyval(alpha, m["f"][:5]) * (1 - b2) + m["f"][5] * e + (polyval(alpha, m["g"]) + d[3]) * qh
    roll_terms = [beta, alpha * beta, a2 * beta, b2, alpha * b2, a3 * beta, alpha**4 * beta, a2 * b2]
    cl = (
        m["h"] @ np.array(roll_terms)
        + (polyval(alpha, m["i"]) + d[5]) * ph
        + (polyval(alpha, m["j"]) + d[4]) * rh
        + a * (m["k"] @ np.array([one, alpha, beta, a2, alpha * beta, a2 * beta, a3]))
        + r * (m["l"] @ np.array([one, alpha, beta, alpha * beta, a2 * beta, a3 * beta, b2]))
    )
    cm = (
        m["m"] @ np.array([one, alpha, e, alpha * e, e**2, a2 * e, e**3, alpha * e**2])
        + (polyval(alpha, m["n"]) + d[6]) * qh
    )
    yaw_of_aileron = [one, alpha, beta, alpha * beta, a2 * beta, a3 * beta, a2, a3, beta**3, alpha * beta**3]
    cn = (
        m["o"] @ np.array([beta, alpha * beta, b2, alpha * b2, a2 * beta, a2 * b2, a3 * beta])
        + (polyval(alpha, m["p"]) + d[8]) * ph
        + (polyval(alpha, m["q"]) + d[7]) * rh
        + a * (m["r"] @ np.array(yaw_of_aileron))
        + r * (m["s"] @ np.array([one, alpha, beta, alpha * beta, a2 * beta, a2]))
    )
    return cx, cy, cz, cl, cm, cn


def _thrust(power: Array, altitude: Array, mach: Array) -> Array:
    """Below military power, which the constant throttle never leaves."""
    column = np.maximum(altitude, 0.01) / 10000
    j, i = np.clip(column.astype(int), 0, 4), np.clip((5 * mach).astype(int), 0, 4)
    s, t = column - j, 5 * mach - i

    def bilinear(table: Array) -> Array:
        low = (1 - s) * table[i, j] + s * table[i, j + 1]
        high = (1 - s) * table[i + 1, j] + s * table[i + 1, j + 1]
        return np.asarray((1 - t) * low + t * high)

    share = power / 50
    return np.asarray((1 - share) * bilinear(_ENGINE["idle"]) + share * bilinear(_ENGINE["military"]))


def _rotation(phi: Array, theta: Array, psi: Array) -> Array:
    """Direction cosines from earth (north, east, down) to body axes, shape (3, 3, runs)."""
    sph, cph, sth, cth = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    sps, cps = np.sin(psi), np.cos(psi)
    return np.array(
        [
            [cth * cps, cth * sps, -sth],
            [sph * sth * cps - cph * sps, sph * sth * sps + cph * cps, sph * cth],
            [cph * sth * cps + sph * sps, cph * sth * sps - sph * cps, cph * cth],
        ]
    )
