"""Single Runge-Kutta steps of a model-exchange FMU, explicit and implicit.

Explicit: Dormand and Prince 5(4), J. Comp. Appl. Math. 6 (1980) 19-26, with the dense output and the
stiffness test of Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.6, and II, IV.2.
Implicit: ARK4(3)6L[2]SA-ESDIRK of Kennedy and Carpenter, Appl. Numer. Math. 44 (2003) 139-181.
"""

import numpy as np

from falsifier.fmu.continuous import copy, derive
from falsifier.fmu.solver_memory import JACOBIAN_KNOWN, TIME
from falsifier.fmu.stepping import compiled

_C = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
_A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
# Weights of the error estimate: fifth-order minus fourth-order solution.
_E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
_DENSE = np.array(
    [
        -12715105075 / 11282082432,
        0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
)

_GAMMA = 0.25
_IC = np.array([0, 1 / 2, 83 / 250, 31 / 50, 17 / 20, 1])
_IA = np.array(
    [
        [0, 0, 0, 0, 0],
        [1 / 4, 0, 0, 0, 0],
        [8611 / 62500, -1743 / 31250, 0, 0, 0],
        [5012029 / 34652500, -654441 / 2922500, 174375 / 388108, 0, 0],
        [15267082809 / 155376265600, -71443401 / 120774400, 730878875 / 902184768, 2285395 / 8070912, 0],
        [82889 / 524892, 0, 15625 / 83664, 69875 / 102672, -2260 / 8211],
    ]
)
_IB = np.array([82889 / 524892, 0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4])
_IE = _IB - np.array(
    [
        4586570599 / 29645900160,
        0,
        178811875 / 945068544,
        814220225 / 1159782912,
        -3700637 / 11593932,
        61727 / 225920,
    ]
)

_MAX_ITERATIONS = 8
# Newton's method stops once its correction is well below the error allowed for the step.
_NEWTON_SHARE = 0.01

# Error of a step that could not be completed; it is retried with a shorter step.
FAILED = np.inf


@compiled
def _norm(m, x, new_x, error):  # type: ignore[no-untyped-def]
    """Return the root mean square of an error, in units of the tolerance."""
    total = 0.0
    for i in range(error.shape[0]):
        scale = m.weights[i] + m.tolerance * max(abs(x[i]), abs(new_x[i]))
        total += (error[i] / scale) ** 2
    return np.sqrt(total / max(error.shape[0], 1))


@compiled
def explicit_step(m, s, h):  # type: ignore[no-untyped-def]
    """Try a step of h from ``s.x`` with derivatives ``s.stages[0]``; store the result in ``s.new_x``.

    Returns:
        FMI status, error in units of the tolerance, and h times an estimate of the dominant eigenvalue.
    """
    time, n = s.clock[TIME], s.x.shape[0]
    k, stage, before = s.stages, s.work[0], s.work[1]
    for i in range(1, 7):
        for e in range(n):
            total = 0.0
            for j in range(i):
                total += _A[i, j] * k[j, e]
            if i == 6:
                before[e] = stage[e]
                s.new_x[e] = s.x[e] + h * total
            else:
                stage[e] = s.x[e] + h * total
        status = derive(m, s, time + _C[i] * h, s.new_x if i == 6 else stage, k[i])
        if status > 1:
            return status, FAILED, 0.0
    numerator, denominator = 0.0, 0.0
    error = s.work[2]
    for e in range(n):
        total = 0.0
        for j in range(7):
            total += _E[j] * k[j, e]
        error[e] = h * total
        numerator += (k[6, e] - k[5, e]) ** 2
        denominator += (s.new_x[e] - before[e]) ** 2
    stiffness = abs(h) * np.sqrt(numerator / denominator) if denominator > 0.0 else 0.0
    return 0, _norm(m, s.x, s.new_x, error), stiffness


@compiled
def implicit_step(m, s, h):  # type: ignore[no-untyped-def]
    """Try an implicit step of h; like explicit_step, but ``s.stages[5]`` is the derivative at the end."""
    while True:
        is_new = not s.counts[JACOBIAN_KNOWN]
        if is_new:
            status = _find_jacobian(m, s)
            if status > 1:
                return status, FAILED, 0.0
        _factorise(s, h * _GAMMA)
        status, converged = _solve_stages(m, s, h)
        if status > 1:
            return status, FAILED, 0.0
        if converged:
            break
        s.counts[JACOBIAN_KNOWN] = 0
        if is_new:
            return 0, FAILED, 0.0
    error = s.work[2]
    for e in range(s.x.shape[0]):
        total = 0.0
        for j in range(6):
            total += _IE[j] * s.stages[j, e]
        error[e] = h * total
    # This difference overestimates the error of stiff components; the step's matrix damps them (Shampine).
    _substitute(s, error)
    return 0, _norm(m, s.x, s.new_x, error), 0.0


@compiled
def _solve_stages(m, s, h):  # type: ignore[no-untyped-def]
    """Solve all implicit stages of a step; return the FMI status and whether all converged."""
    k, base, n = s.stages, s.work[0], s.x.shape[0]
    for i in range(1, 6):
        for e in range(n):
            total = 0.0
            for j in range(i):
                total += _IA[i, j] * k[j, e]
            base[e] = s.x[e] + h * total
            s.new_x[e] = base[e] + h * _GAMMA * k[i - 1, e]
        status, converged = _solve_stage(m, s, s.clock[TIME] + _IC[i] * h, h * _GAMMA, k[i])
        if status > 1 or not converged:
            return status, False
    return 0, True


@compiled
def _solve_stage(m, s, time, hg, derivatives):  # type: ignore[no-untyped-def]
    """Solve one stage for ``s.new_x`` by Newton's method; return the FMI status and whether it converged."""
    n = s.x.shape[0]
    base, residual = s.work[0], s.work[1]
    last = np.inf
    for _ in range(_MAX_ITERATIONS):
        status = derive(m, s, time, s.new_x, derivatives)
        if status > 1:
            return status, False
        for e in range(n):
            residual[e] = base[e] + hg * derivatives[e] - s.new_x[e]
        _substitute(s, residual)
        size = _norm(m, s.x, s.new_x, residual)
        if not np.isfinite(size) or size > 2.0 * last:
            return 0, False
        for e in range(n):
            s.new_x[e] += residual[e]
        if size < _NEWTON_SHARE:
            for e in range(n):
                derivatives[e] = (s.new_x[e] - base[e]) / hg
            return 0, True
        last = size
    return 0, False


@compiled
def _find_jacobian(m, s):  # type: ignore[no-untyped-def]
    """Approximate the Jacobian at the start of the step by forward differences; return the FMI status."""
    time, n = s.clock[TIME], s.x.shape[0]
    base, moved, at = s.work[1], s.work[2], s.work[3]
    copy(at, s.x)
    status = derive(m, s, time, at, base)
    if status > 1:
        return status
    for j in range(n):
        # 1.5e-8 is the square root of the machine precision, relative to the state or, near 0, to its nominal
        # value, which the weight contains. The second line makes delta exactly representable.
        delta = 1.5e-8 * max(abs(s.x[j]), 100.0 * m.weights[j] / m.tolerance)
        at[j] = s.x[j] + delta
        delta = at[j] - s.x[j]
        status = derive(m, s, time, at, moved)
        if status > 1:
            return status
        at[j] = s.x[j]
        for i in range(n):
            s.jacobian[i, j] = (moved[i] - base[i]) / delta
    s.counts[JACOBIAN_KNOWN] = 1
    return 0


@compiled
def _factorise(s, hg):  # type: ignore[no-untyped-def]
    """Factorise 1 - hg J into triangular matrices, with row exchanges."""
    a, n = s.factors, s.x.shape[0]
    for i in range(n):
        for j in range(n):
            a[i, j] = (1.0 if i == j else 0.0) - hg * s.jacobian[i, j]
    for c in range(n):
        p = c
        for i in range(c + 1, n):
            if abs(a[i, c]) > abs(a[p, c]):
                p = i
        s.pivots[c] = p
        if p != c:
            for j in range(n):
                a[c, j], a[p, j] = a[p, j], a[c, j]
        if a[c, c] == 0.0:
            # Newton's method then diverges, and the step is retried with a new Jacobian or a shorter step.
            a[c, c] = 1e-300
        for i in range(c + 1, n):
            a[i, c] /= a[c, c]
            for j in range(c + 1, n):
                a[i, j] -= a[i, c] * a[c, j]


@compiled
def _substitute(s, b):  # type: ignore[no-untyped-def]
    """Solve the linear system with the factors, in place of the right-hand side ``b``."""
    a, n = s.factors, b.shape[0]
    for c in range(n):
        p = s.pivots[c]
        b[c], b[p] = b[p], b[c]
    for i in range(n):
        for j in range(i):
            b[i] -= a[i, j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]


@compiled
def interpolate(s, h, theta, end_stage, x):  # type: ignore[no-untyped-def]
    """Interpolate the state at ``theta`` in [0, 1] of the last trial step; cubic after an implicit step."""
    k = s.stages
    for e in range(s.x.shape[0]):
        change = s.new_x[e] - s.x[e]
        bend = h * k[0, e] - change
        twist = change - h * k[end_stage, e] - bend
        correction = 0.0
        if end_stage == 6:
            for j in range(7):
                correction += _DENSE[j] * k[j, e]
        rest = 1.0 - theta
        x[e] = s.x[e] + theta * (change + rest * (bend + theta * (twist + rest * h * correction)))
