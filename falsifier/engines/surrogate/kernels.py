"""Compiled rollouts of learnt dynamics: a plan needs thousands, one cell after the other.

Importing this module imports numba, which the monitor has done by then.
"""

from functools import partial

import numpy as np

from falsifier.engines.box import Array
from falsifier.stl.numba_compilation import compiled

# cos(2 pi x) on [-1/2, 1/2] as an even polynomial, to 1e-6; unlike the library's cosine, the compiler
# calculates it for several numbers at a time.
_C0, _C1, _C2 = np.float32(0.999999211), np.float32(-19.7389804), np.float32(64.9286574)
_C3, _C4, _C5 = np.float32(-85.2716215), np.float32(58.7904921), np.float32(-21.0711056)
_HALF = np.float32(0.5)


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

    Args:
        own: next states and excesses, linear in the last states, the oldest first, shape
            (n + leaves, lags * n).
        driving: the same, linear in the last inputs, shape (n + leaves, lags * u).
        far: largest absolute value of a state.
        inputs: one after the other, shape (m, (lags - 1 + cells) * u); the first are those before the start.
        states: one after the other, shape (m, (lags + cells) * n); the first ``lags`` are given, the others
            are filled in.
        excess: shape (m, cells, leaves), to be filled in.
    """
    count, cells, leaves = excess.shape
    n = len(own) - leaves
    driven = driving.shape[1] // (own.shape[1] // n)
    for row in range(count):
        for cell in range(cells):
            for out in range(n + leaves):
                step = 0.0
                for i in range(own.shape[1]):
                    step += own[out, i] * states[row, cell * n + i]
                for i in range(driving.shape[1]):
                    step += driving[out, i] * inputs[row, cell * driven + i]
                if out < n:
                    states[row, cell * n + own.shape[1] + out] = min(max(step, -far), far)
                else:
                    excess[row, cell, out - n] = step
