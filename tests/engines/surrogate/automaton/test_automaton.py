from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from falsifier.engines.surrogate.automaton.automaton import learn
from falsifier.engines.surrogate.automaton.modes import Modes, find_modes
from falsifier.engines.surrogate.automaton.recording import Recording
from tests.engines.surrogate.automaton.support import CELL, CONVOY, PUCK, STEP, System, driven


@pytest.mark.parametrize("system", [PUCK, CONVOY])
def test_it_predicts_inputs_that_it_was_not_learnt_from(system: System) -> None:
    automaton = learn([system.solve(u) for u in driven(3)], np.random.default_rng(0))
    assert automaton is not None
    for inputs in driven(3, seed=7):
        true = system.solve(inputs)
        samples, first = automaton.trajectory(inputs[:, None], true.outputs[0], true.starting_velocity, CELL)
        assert samples[first] == pytest.approx(true.outputs[:: round(CELL / STEP)], abs=1e-3)


def test_smooth_motion_and_noise_are_left_to_other_dynamics() -> None:
    rng = np.random.default_rng(0)
    smooth = [System((0.0,), lambda modes, u: [u], ()).solve(u) for u in driven(3)]
    assert learn(smooth, rng) is None
    noisy = [
        Recording(r.step, r.outputs + 0.01 * rng.standard_normal(r.outputs.shape), r.inputs) for r in smooth
    ]
    assert learn(noisy, rng) is None


def test_noise_on_events_is_refused() -> None:
    rng = np.random.default_rng(0)
    true = [PUCK.solve(u) for u in driven(3)]
    noisy = [
        Recording(r.step, r.outputs + 1e-3 * rng.standard_normal(r.outputs.shape), r.inputs) for r in true
    ]
    assert learn(noisy, rng) is None


def test_laws_faster_than_the_output_interval_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from falsifier.engines.surrogate.automaton import automaton

    def hasty(*arguments: Any) -> Modes | None:
        found = find_modes(*arguments)
        assert found is not None
        laws = found.laws.copy()
        laws[:, 1] = -1e9
        return replace(found, laws=laws)

    monkeypatch.setattr(automaton, "find_modes", hasty)
    # A roll-out would take 1e11 steps.
    assert learn([PUCK.solve(u) for u in driven(3)], np.random.default_rng(0)) is None
