"""Compiled loops: one call evaluates a whole formula, on one trajectory or on many.

Importing this module imports numba, so the monitor does so only when it evaluates its first trajectory.
Sliding windows take linear time for any window length, with van Herk's algorithm (M. van Herk, "A fast
algorithm for local minimum and maximum filters on rectangular and octagonal kernels", Pattern Recognition
Letters 13, 1992).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from falsifier.stl import opcodes as op
from falsifier.stl.numba_compilation import compiled

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Status of an evaluation: fine, uneven time grid, non-finite sample of a signal, non-finite result of a step.
FINE, BAD_TIME, BAD_SIGNAL, BAD_STEP = 0, 1, 2, 3

_TIME_TOLERANCE = 1e-6  # as a fraction of one sampling step


@compiled
def judge(
    program: Integers, numbers: Floats, buffer: Floats, signal_size: int, times: Floats, step: float
) -> tuple[int, int]:
    """Check one trajectory and evaluate a program on it; return a status and the position of the problem.

    Args:
        program: rows as described in opcodes, shape (r, 6).
        numbers: two constants for each row, shape (r, 2).
        buffer: all signals, one after the other, then space for the results of all rows.
        signal_size: length of the signals' part.
        times: time grid in s, shape (n,).
        step: sampling step in s that the grid must have.
    """
    late = _first_uneven(times, step)
    if late >= 0:
        return BAD_TIME, late
    return _run(program, numbers, buffer, signal_size)


@compiled
def judge_many(
    program: Integers, numbers: Floats, buffer: Floats, columns: Any, root: int, result: Floats
) -> tuple[int, int, int]:
    """Evaluate a program on many trajectories; return a status, the trajectory's index and the position.

    Args:
        program: see judge.
        numbers: see judge.
        buffer: see judge.
        columns: samples by signal and trajectory, shape (k, m, n).
        root: offset of the formula's value at time 0.
        result: receives the robustness of each trajectory, shape (m,).
    """
    signals, count, samples = columns.shape
    for j in range(count):
        for i in range(signals):
            buffer[i * samples : (i + 1) * samples] = columns[i, j]
        status, position = _run(program, numbers, buffer, signals * samples)
        if status != FINE:
            return status, j, position
        result[j] = buffer[root]
    return FINE, 0, 0


@compiled
def _run(program: Integers, numbers: Floats, buffer: Floats, signal_size: int) -> tuple[int, int]:
    bad = _first_infinite(buffer[:signal_size])
    if bad >= 0:
        return BAD_SIGNAL, bad
    for r in range(program.shape[0]):
        code, start, first, second, length, width = program[r]
        out = buffer[start : start + length]
        a = buffer[first : first + length + width]
        b = buffer[second : second + length]
        if code == op.CHECK:
            if not _settled(a, numbers[r, 0]):
                return BAD_STEP, r
        elif code >= op.WINDOW_MINIMUM:
            _temporal(code, out, a, b)
        elif code >= op.ABS:
            _function(code, out, a)
        elif code >= op.ADD:
            _arithmetic(code, out, a, b)
        elif code == op.SCALE:
            p, q = numbers[r]
            for i in range(length):
                out[i] = p * a[i] + q
        else:
            out[:] = numbers[r, 1]
    return FINE, 0


@compiled
def _arithmetic(code: int, out: Floats, a: Floats, b: Floats) -> None:
    length = out.size
    if code == op.ADD:
        for i in range(length):
            out[i] = a[i] + b[i]
    elif code == op.SUBTRACT:
        for i in range(length):
            out[i] = a[i] - b[i]
    elif code == op.MULTIPLY:
        for i in range(length):
            out[i] = a[i] * b[i]
    elif code == op.DIVIDE:
        for i in range(length):
            out[i] = a[i] / b[i]
    elif code == op.POWER:
        for i in range(length):
            out[i] = a[i] ** b[i]
    elif code == op.MINIMUM:
        for i in range(length):
            out[i] = a[i] if a[i] <= b[i] else b[i]
    else:
        for i in range(length):
            out[i] = a[i] if a[i] >= b[i] else b[i]


@compiled
def _function(code: int, out: Floats, a: Floats) -> None:
    if code == op.ABS:
        for i in range(out.size):
            out[i] = abs(a[i])
    elif code == op.SQRT:
        out[:] = np.sqrt(a)
    elif code == op.EXP:
        out[:] = np.exp(a)
    elif code == op.LOG:
        out[:] = np.log(a)
    elif code == op.SIN:
        out[:] = np.sin(a)
    else:
        out[:] = np.cos(a)


@compiled
def _temporal(code: int, out: Floats, a: Floats, b: Floats) -> None:
    if code == op.WINDOW_MINIMUM:
        _slide(out, a, 1.0)
    elif code == op.WINDOW_MAXIMUM:
        _slide(out, a, -1.0)
    elif code == op.UNTIL:
        last = out.size - 1
        out[last] = b[last]
        for i in range(last - 1, -1, -1):
            out[i] = max(b[i], min(a[i], out[i + 1]))
    else:
        sign = 1.0 if code == op.REST_MINIMUM else -1.0
        best = np.inf
        for i in range(out.size - 1, -1, -1):
            best = min(best, sign * a[i])
            out[i] = sign * best


@compiled
def _slide(out: Floats, a: Floats, sign: float) -> None:
    """Write to ``out`` the minimum (sign 1) or maximum (sign -1) of ``a`` over the window from each sample.

    Blocks are as long as a window, so each window consists of the end of one block and the start of the next.
    """
    length, width = out.size, a.size - out.size
    if length == 1:
        out[0] = sign * _smallest(a, sign)
        return
    for block in range(0, length, width + 1):
        best = np.inf
        for i in range(block + width, block - 1, -1):
            best = min(best, sign * a[i])
            if i < length:
                out[i] = best
        best = np.inf
        for i in range(block, min(block + width + 1, length)):
            if i > block:
                best = min(best, sign * a[i + width])
            out[i] = sign * min(out[i], best)


@compiled
def _smallest(a: Floats, sign: float) -> float:
    best = np.inf
    for i in range(a.size):
        best = min(best, sign * a[i])
    return best


@compiled
def _settled(margins: Floats, on_limit: float) -> bool:
    """Replace margins of 0 by a value with the sign of the comparison; return whether all are finite."""
    # The first loop has no branch, so it is vectorised; the others run only if there is something to do.
    bad, ties = 0, 0
    for i in range(margins.size):
        bad += margins[i] - margins[i] != 0.0
        ties += margins[i] == 0.0
    if ties:
        for i in range(margins.size):
            margins[i] = on_limit if margins[i] == 0.0 else margins[i]
    return bad == 0


@compiled
def _first_infinite(a: Floats) -> int:
    """Return the position of the first value that is NaN or infinite, -1 if there is none."""
    # The first loop has no branch, so it is vectorised; the search runs only if there is something to find.
    count = 0
    for i in range(a.size):
        count += a[i] - a[i] != 0.0
    if count:
        for i in range(a.size):
            if not np.isfinite(a[i]):
                return i
    return -1


@compiled
def _first_uneven(times: Floats, step: float) -> int:
    """Return the position of the first sample that is not on the grid 0, step, 2*step, ...; -1 if all are."""
    count = 0
    tolerance = _TIME_TOLERANCE * step
    for i in range(times.size):
        count += not abs(times[i] - i * step) <= tolerance
    if count:
        for i in range(times.size):
            if not abs(times[i] - i * step) <= tolerance:
                return i
    return -1
