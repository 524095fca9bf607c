from collections.abc import Sequence

import numpy as np
import pytest

from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.guards import Guard, find_guards
from falsifier.engines.surrogate.automaton.modes import find_modes
from falsifier.engines.surrogate.automaton.recording import Motion, Recording
from tests.engines.surrogate.automaton.support import CONVOY, PUCK, Event, System, driven


def guards(recordings: Sequence[Recording]) -> list[Guard] | None:
    motions = [Motion.of(recordings, i) for i in range(recordings[0].outputs.shape[1])]
    modes = [find_modes(recordings, motion, np.random.default_rng(0)) for motion in motions]
    return find_guards(recordings, motions, [found for found in modes if found is not None])


def test_two_walls() -> None:
    found = guards([PUCK.solve(u) for u in driven(3)])
    assert found is not None
    right, left = sorted(found, key=lambda g: -g.threshold)
    assert (right.threshold, right.direction, right.factor) == pytest.approx((1.0, 1.0, -1.0), abs=1e-6)
    assert (left.threshold, left.direction, left.factor) == pytest.approx((0.0, -1.0, -0.95), abs=1e-6)
    assert {(g.high, g.low, g.source, g.target) for g in found} == {(0, -1, 0, 0)}


def test_thresholds_of_a_distance_although_another_output_rests() -> None:
    recordings = [CONVOY.solve(u) for u in driven(3)]
    resting = [Recording(r.step, np.insert(r.outputs, 2, 30.0, axis=1), r.inputs) for r in recordings]
    found = guards(resting)
    assert found is not None
    assert {(g.output, g.high, g.low) for g in found} == {(1, 1, 0)}
    assert {g.direction: g.threshold for g in found} == pytest.approx({1.0: 15.0, -1.0: 10.0}, abs=1e-6)
    assert [g.factor for g in found] == pytest.approx([-1.0, -1.0])


def test_events_that_no_threshold_explains_are_not_understood() -> None:
    hidden = np.random.default_rng(3)

    def kicked(inputs: Array) -> Recording:
        quiet = System((0.0,), lambda modes, u: [u], ()).solve(inputs)
        outputs = quiet.outputs.copy()
        for at in hidden.integers(100, len(outputs) - 100, size=8):
            # A kick at a time that nothing announces.
            later = np.arange(len(outputs) - at) * quiet.step
            outputs[at:, 0] += 3.0 * later
        return Recording(quiet.step, outputs, quiet.inputs)

    assert guards([kicked(u) for u in driven(4)]) is None


def test_modes_that_change_without_a_jump_are_not_understood() -> None:
    # The thrust is reversed at two places; velocities do not jump, so the places are not known well.
    shuttle = System(
        (0.0,),
        lambda modes, u: [-1.0 if modes[0] else 1.0],
        (Event(0, 0, 1, (1.0,), 1.0, 1), Event(0, 1, 0, (1.0,), -1.0, -1)),
    )
    assert guards([shuttle.solve(u) for u in driven(2)]) is None


def test_an_input_that_switches_is_no_event() -> None:
    free = System((0.0,), lambda modes, u: [2.0 * u - 1.0], ())
    assert guards([free.solve(u) for u in driven(3)]) == []
