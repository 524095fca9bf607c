"""The compiled rollouts against the same recursions in numpy."""

import numpy as np

from falsifier.engines.surrogate.kernels import roll_out_deviations, roll_out_modes, roll_out_waves

TRACES, CELLS, STATES, INPUTS, LEAVES, FEATURES, LAGS = 3, 7, 2, 2, 1, 20, 3


def test_waves_follow_cosines_of_state_and_inputs_within_bounds() -> None:
    rng = np.random.default_rng(0)
    to_turns = rng.standard_normal((STATES + INPUTS + 1, FEATURES)).astype(np.float32)
    to_steps = rng.standard_normal((STATES + LEAVES, FEATURES + STATES + INPUTS + 1)).astype(np.float32) / 5
    low, high = np.array([[-1.5, -9.0], [1.5, 9.0]], dtype=np.float32)
    inputs = rng.random((TRACES, CELLS, INPUTS), dtype=np.float32)
    states = np.zeros((TRACES, CELLS + 1, STATES), np.float32)
    excess = np.empty((TRACES, CELLS, LEAVES), np.float32)
    roll_out_waves(to_turns, to_steps, low, high, inputs, states, excess)
    for k in range(CELLS):
        known = np.concatenate([states[:, k], inputs[:, k], np.ones((TRACES, 1), np.float32)], axis=1)
        basis = np.concatenate([np.cos(2 * np.pi * (known @ to_turns)), known], axis=1)
        step = basis @ to_steps.T
        np.testing.assert_allclose(
            states[:, k + 1], np.clip(states[:, k] + step[:, :STATES], low, high), atol=1e-4
        )
        np.testing.assert_allclose(excess[:, k], step[:, STATES:], atol=1e-4)
    assert (np.abs(states[..., 0]) <= 1.5).all() and (np.abs(states[..., 0]) == 1.5).any()


def test_deviations_follow_the_last_states_and_inputs() -> None:
    rng = np.random.default_rng(1)
    own = rng.standard_normal((STATES + LEAVES, LAGS, STATES))
    driving = rng.standard_normal((STATES + LEAVES, LAGS, INPUTS))
    inputs = rng.standard_normal((LAGS - 1 + CELLS, INPUTS, TRACES))
    states = np.zeros((LAGS + CELLS, STATES, TRACES))
    excess = np.empty((CELLS, LEAVES, TRACES))
    roll_out_deviations(own, driving, 4.0, inputs, states, excess)
    for k in range(CELLS):
        step = np.einsum("oli,lim->om", own, states[k : k + LAGS])
        step += np.einsum("oli,lim->om", driving, inputs[k : k + LAGS])
        np.testing.assert_allclose(states[k + LAGS], np.clip(step[:STATES], -4.0, 4.0))
        np.testing.assert_allclose(excess[k], step[STATES:])
    assert (np.abs(states) == 4.0).any()


def test_modes_change_where_a_surface_is_positive_and_have_their_own_steps() -> None:
    rng = np.random.default_rng(2)
    factors = np.array([[i, j] for i in range(STATES + INPUTS + 1) for j in range(i + 1)])
    mean, unit = rng.standard_normal(STATES + INPUTS), rng.uniform(1.0, 2.0, STATES + INPUTS)
    steps = rng.standard_normal((3, len(factors), STATES + LEAVES)) / 5
    surfaces, ends = rng.standard_normal((4, len(factors))), np.array([1, 3, 4])
    followers = np.array([1, 0, 2, 0])
    low, high = np.array([-1.5, -9.0]), np.array([1.5, 9.0])
    inputs, modes = rng.random((TRACES, CELLS, INPUTS)), np.zeros((TRACES, CELLS + 1), np.intp)
    modes[:, 0] = [0, 1, 2]
    states, excess = np.zeros((TRACES, CELLS + 1, STATES)), np.empty((TRACES, CELLS, LEAVES))
    roll_out_modes(
        factors, mean, unit, steps, surfaces, ends, followers, low, high, inputs, modes, states, excess
    )
    owners = np.searchsorted(ends, np.arange(4), side="right")
    for row in range(TRACES):
        for k in range(CELLS):
            known = (np.concatenate([states[row, k], inputs[row, k]]) - mean) / unit
            products = np.append(known, 1.0)[factors].prod(axis=1)
            mode = modes[row, k]
            scores = np.where(owners == mode, surfaces @ products, -np.inf)
            assert modes[row, k + 1] == (followers[scores.argmax()] if scores.max() > 0 else mode)
            step = products @ steps[mode]
            np.testing.assert_allclose(
                states[row, k + 1], np.clip(states[row, k] + step[:STATES], low, high), atol=1e-9
            )
            np.testing.assert_allclose(excess[row, k], step[STATES:], atol=1e-9)
    assert set(np.unique(modes)) == {0, 1, 2}
