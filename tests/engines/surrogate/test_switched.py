import numpy as np

from falsifier.engines.surrogate.dynamics import DeviationDynamics, FourierDynamics, Traces
from falsifier.engines.surrogate.switched import SwitchedDynamics, discrete_states, has_modes
from tests.engines.surrogate.support import SETTINGS

CELLS = 60


def gearbox(count: int, *, seed: int, gears: int = 2) -> Traces:
    """Simulate a speed that follows the input, faster in a high gear; gears change with hysteresis."""
    rng = np.random.default_rng(seed)
    inputs = np.repeat(rng.random((count, CELLS // 10, 1)), 10, axis=1)
    states = np.zeros((count, CELLS + 1, 2))
    for row in range(count):
        for k in range(CELLS):
            speed, gear = states[row, k]
            after = speed + (0.05 + 0.05 * gear) * (inputs[row, k, 0] - speed)
            up, down = speed > 0.4 + 0.2 * gear, speed < 0.1 + 0.2 * (gear - 1)
            states[row, k + 1] = after, np.clip(gear + int(up) - int(down), 0, gears - 1)
    return Traces(inputs, states, np.zeros((count, CELLS, 1)))


def test_the_times_of_mode_changes_are_predicted() -> None:
    known, unseen = gearbox(40, seed=0), gearbox(30, seed=1)
    start = unseen.states[:, 0]
    wrong = {}
    for kind in (SwitchedDynamics, FourierDynamics, DeviationDynamics):
        fitted = kind(known, [0, 1, 2], SETTINGS, np.random.default_rng(0))
        predicted = fitted.predict(unseen.inputs, start).states
        wrong[kind] = np.mean(np.rint(predicted[:, :, 1]) != unseen.states[:, :, 1])
        if kind is SwitchedDynamics:
            assert np.abs(predicted[:, :, 0] - unseen.states[:, :, 0]).mean() < 0.02
            assert set(np.unique(predicted[:, :, 1])) == {0.0, 1.0}
    assert wrong[SwitchedDynamics] < 0.02
    assert wrong[SwitchedDynamics] < 0.5 * min(wrong[FourierDynamics], wrong[DeviationDynamics])


def test_more_rows_than_wanted_are_drawn_and_give_the_same_surfaces() -> None:
    known, unseen = gearbox(200, seed=0), gearbox(30, seed=1)
    few = SwitchedDynamics(known, [], type(SETTINGS)(most_rows=1000), np.random.default_rng(0))
    predicted = few.predict(unseen.inputs, unseen.states[:, 0]).states
    assert np.mean(predicted[:, :, 1] != unseen.states[:, :, 1]) < 0.02


def test_modes_that_follow_others_are_told_apart() -> None:
    known, unseen = gearbox(60, seed=0, gears=3), gearbox(30, seed=1, gears=3)
    assert set(np.unique(known.states[:, :, 1])) == {0.0, 1.0, 2.0}
    fitted = SwitchedDynamics(known, [0], SETTINGS, np.random.default_rng(0))
    predicted = fitted.predict(unseen.inputs, unseen.states[:, 0]).states
    assert np.mean(predicted[:, :, 1] != unseen.states[:, :, 1]) < 0.04


def test_discrete_states_are_integers_that_change() -> None:
    states = np.zeros((2, 5, 4))
    states[:, :, 1] = np.arange(5)
    states[:, :, 2] = np.arange(5) / 2
    states[1, :, 3] = 1.0
    assert discrete_states(states).tolist() == [False, True, False, True]
    assert has_modes(states)
    assert not has_modes(states[:, :, [0, 2]]), "nothing is discrete"
    assert not has_modes(states[:, :, [2, 3]]), "a mode that never changes within a trace has no surface"
    assert not has_modes(np.repeat(np.arange(50.0)[None, :, None], 2, axis=0)), "too many"


def test_without_other_states_the_input_decides_the_mode() -> None:
    rng = np.random.default_rng(0)
    inputs = np.repeat(rng.random((20, CELLS // 10, 1)), 10, axis=1)
    modes = np.concatenate([np.zeros((20, 1, 1)), (inputs > 0.6).astype(np.float64)], axis=1)
    fitted = SwitchedDynamics(Traces(inputs, modes, np.zeros((20, CELLS, 1))), [], SETTINGS, rng)
    predicted = fitted.predict(inputs, modes[:, 0]).states
    assert np.mean(predicted != modes) < 0.02
