"""Compiled rollouts of learnt dynamics: a plan needs thousands, one cell after the other.

Importing this module imports numba.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.numba_compilation import compiled

# cos(2 pi x) on [-1/2, 1/2] as an even polynomial, to 1e-6; unlike the library's cosine, the compiler
# calculates it for several numbers at a time.
_C0, _C1, _C2 = np.float32(0.999999211), np.float32(-19.7389804), np.float32(64.9286574)
_C3, _C4, _C5 = np.float32(-85.2716215), np.float32(58.7904921), np.float32(-21.0711056)
_HALF = np.float32(0.5)

Ints = NDArray[np.intp]


@partial(compiled, fastmath=True)
def roll_out_waves(
    to_turns: Array, to_steps: Array, low: Array, high: Array, inputs: Array, states: Array, excess: Array
) -> None:
    """Predict m traces with dynamics whose increments are linear in cosines, the state and the inputs.

    Args:
        to_turns: arguments of the cosines in whole turns, linear in state, inputs and one, shape
            (n + u + 1, f).
        to_steps: increments and excesses, linear in the cosines, state, inputs and one, shape
            (n + leaves, f + n + u + 1).
        low: smallest states, shape (n,).
        high: largest states, shape (n,).
        inputs: shape (m, cells, u).
        states: shape (m, cells + 1, n); the first ones are given, the others are filled in.
        excess: shape (m, cells, leaves), to be filled in.
    """
    count, cells, driven = inputs.shape
    n, leaves, features = states.shape[2], excess.shape[2], to_turns.shape[1]
    known = np.ones(n + driven + 1, dtype=np.float32)
    turns = np.empty(features, dtype=np.float32)
    for row in range(count):
        for cell in range(cells):
            for i in range(n):
                known[i] = states[row, cell, i]
            for i in range(driven):
                known[n + i] = inputs[row, cell, i]
            for f in range(features):
                turns[f] = to_turns[n + driven, f]
            for i in range(n + driven):
                for f in range(features):
                    turns[f] += known[i] * to_turns[i, f]
            for f in range(features):
                part = turns[f] - np.floor(turns[f] + _HALF)
                x = part * part
                turns[f] = _C0 + x * (_C1 + x * (_C2 + x * (_C3 + x * (_C4 + x * _C5))))
            for out in range(n + leaves):
                step = np.float32(0.0)
                for f in range(features):
                    step += turns[f] * to_steps[out, f]
                for i in range(n + driven + 1):
                    step += known[i] * to_steps[out, features + i]
                if out < n:
                    after = states[row, cell, out] + step
                    states[row, cell + 1, out] = min(max(after, low[out]), high[out])
                else:
                    excess[row, cell, out - n] = step


@partial(compiled, fastmath=True)
def roll_out_deviations(
    own: Array, driving: Array, far: float, inputs: Array, states: Array, excess: Array
) -> None:
    """Predict m traces with linear dynamics that look back on a number of cells.

    The traces are the last axis of all arrays: the compiler then calculates several at a time.

    Args:
        own: next states and excesses, linear in the last states, the oldest first, shape
            (n + leaves, lags, n).
        driving: the same, linear in the last inputs, shape (n + leaves, lags, u).
        far: largest absolute value of a state.
        inputs: shape (lags - 1 + cells, u, m); the first are those before the start.
        states: shape (lags + cells, n, m); the first ``lags`` are given, the others are filled in.
        excess: shape (cells, leaves, m), to be filled in.
    """
    cells, _, count = excess.shape
    outs, lags, n = own.shape
    driven = driving.shape[2]
    step = np.empty(count, states.dtype)
    for cell in range(cells):
        for out in range(outs):
            step[:] = 0.0
            for lag in range(lags):
                for i in range(n):
                    weight = own[out, lag, i]
                    for row in range(count):
                        step[row] += weight * states[cell + lag, i, row]
                for i in range(driven):
                    weight = driving[out, lag, i]
                    for row in range(count):
                        step[row] += weight * inputs[cell + lag, i, row]
            if out < n:
                for row in range(count):
                    states[cell + lags, out, row] = min(max(step[row], -far), far)
            else:
                for row in range(count):
                    excess[cell, out - n, row] = step[row]


@partial(compiled, fastmath=True)
def roll_out_modes(
    factors: Ints,
    mean: Array,
    unit: Array,
    steps: Array,
    surfaces: Array,
    ends: Ints,
    followers: Ints,
    low: Array,
    high: Array,
    inputs: Array,
    modes: Ints,
    states: Array,
    excess: Array,
) -> None:
    """Predict m traces with dynamics that differ between modes and are linear in products.

    Args:
        factors: factors of each product among state, input and one, shape (p, degree).
        mean: mean of state and input, shape (n + u,).
        unit: their units, shape (n + u,).
        steps: increments and excesses in each mode, shape (modes, p, n + leaves).
        surfaces: where this sum of products is positive, a mode changes, shape (s, p).
        ends: end of each mode's surfaces, shape (modes,).
        followers: mode after each surface, shape (s,).
        low: smallest states, shape (n,).
        high: largest states, shape (n,).
        inputs: shape (m, cells, u).
        modes: shape (m, cells + 1); the first ones are given, the others are filled in.
        states: shape (m, cells + 1, n); the first ones are given, the others are filled in.
        excess: shape (m, cells, leaves), to be filled in.
    """
    count, cells, driven = inputs.shape
    n, leaves = states.shape[2], excess.shape[2]
    products, degree = factors.shape
    known = np.ones(n + driven + 1)
    z = np.empty(products)
    for row in range(count):
        for cell in range(cells):
            for i in range(n):
                known[i] = (states[row, cell, i] - mean[i]) / unit[i]
            for i in range(n, n + driven):
                known[i] = (inputs[row, cell, i - n] - mean[i]) / unit[i]
            for p in range(products):
                z[p] = known[factors[p, 0]]
                for d in range(1, degree):
                    z[p] *= known[factors[p, d]]
            mode = after = modes[row, cell]
            farthest = 0.0
            for s in range(ends[mode - 1] if mode else 0, ends[mode]):
                score = 0.0
                for p in range(products):
                    score += z[p] * surfaces[s, p]
                if score > farthest:
                    farthest, after = score, followers[s]
            modes[row, cell + 1] = after
            for out in range(n + leaves):
                step = 0.0
                for p in range(products):
                    step += z[p] * steps[mode, p, out]
                if out < n:
                    states[row, cell + 1, out] = min(max(states[row, cell, out] + step, low[out]), high[out])
                else:
                    excess[row, cell, out - n] = step


@compiled
def slide(values: Array, first: int, last: int, sign: float, extremes: Array) -> None:
    """Find the extreme of a window that slides along each row; the last value continues beyond the end.

    Windows of doubling width are combined, so the cost grows with the logarithm of the window's width.

    Args:
        values: shape (m, n).
        first: offset of the window's first value from its place, from 0 to n - 1.
        last: offset of its last value, from first to n - 1.
        sign: 1 for the lowest value, -1 for the highest.
        extremes: shape (m, n), to be filled in.
    """
    rows, count = values.shape
    width = last - first + 1
    before = np.empty(count + last, values.dtype)
    after = np.empty(count + last, values.dtype)
    for row in range(rows):
        for i in range(count):
            before[i] = sign * values[row, i]
        for i in range(count, count + last):
            before[i] = before[count - 1]
        covered = 1
        while 2 * covered <= width:
            for i in range(count + last - covered):
                after[i] = min(before[i], before[i + covered])
            before, after = after, before
            # What is left of the row is not used: it lies beyond the end of the last window.
            covered *= 2
        tail = first + width - covered
        for i in range(count):
            extremes[row, i] = sign * min(before[first + i], before[tail + i])
