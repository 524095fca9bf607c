import numpy as np
import pytest

from falsifier.engines.surrogate.automaton.modes import features, find_modes
from falsifier.engines.surrogate.automaton.recording import Motion, Recording
from tests.engines.surrogate.automaton.support import CONVOY, PUCK, STEP, driven


def test_the_simplest_law_explains_a_puck() -> None:
    recordings = [PUCK.solve(u) for u in driven(3)]
    found = find_modes(recordings, Motion.of(recordings, 0), np.random.default_rng(0))
    assert found is not None
    assert found.laws == pytest.approx(np.array([[-1.0, 0.0, 0.0, 2.0, 0.0]]), abs=1e-6)
    assert (found.labels == 0).all()


def test_two_laws_explain_a_car_that_changes_its_mode() -> None:
    recordings = [CONVOY.solve(u) for u in driven(3)]
    found = find_modes(recordings, Motion.of(recordings, 1), np.random.default_rng(0))
    assert found is not None
    assert sorted(found.laws[:, 0]) == pytest.approx([-1.0, 0.0], abs=1e-6)
    assert not found.laws[:, 1:].any()
    assert set(found.labels) == {0, 1}


def test_damping_by_an_input_is_a_law() -> None:
    rng, inputs, outputs = np.random.default_rng(1), [], []
    for _ in range(3):
        u = np.repeat(rng.random((4, 2)), 100, axis=0)
        y, v, column = 0.0, 0.0, []
        for now in u:
            column.append(y)
            # Exact for constant inputs.
            decay = np.exp(-(0.1 + now[1]) * STEP)
            limit = now[0] / (0.1 + now[1])
            y += limit * STEP + (v - limit) * (1 - decay) / (0.1 + now[1])
            v = limit + (v - limit) * decay
        inputs.append(u)
        outputs.append(np.array(column)[:, None])
    recordings = [Recording(STEP, y, u) for y, u in zip(outputs, inputs, strict=True)]
    found = find_modes(recordings, Motion.of(recordings, 0), np.random.default_rng(0))
    assert found is not None
    assert found.laws == pytest.approx(np.array([[0.0, -0.1, 0.0, 1.0, 0.0, 0.0, -1.0]]), abs=1e-3)


def test_noise_has_no_law() -> None:
    rng = np.random.default_rng(0)
    recordings = [Recording(STEP, rng.random((500, 1)), np.zeros((500, 1))) for _ in range(2)]
    assert find_modes(recordings, Motion.of(recordings, 0), np.random.default_rng(0)) is None


def test_features_of_two_inputs() -> None:
    row = features(np.array([5.0]), np.array([3.0]), np.array([[0.5, 1.0]]))
    assert row.tolist() == [[1.0, 3.0, 5.0, 0.5, 1.0, 1.5, 3.0]]
