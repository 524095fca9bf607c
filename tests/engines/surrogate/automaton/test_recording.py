import numpy as np
import pytest

from falsifier.engines.surrogate.automaton.recording import Motion, Recording
from tests.engines.surrogate.automaton.support import CELL, PUCK, STEP, driven


def parabola(*, inputs: float = 0.0) -> Recording:
    times = np.arange(101) * STEP
    return Recording(STEP, (3.0 + 2.0 * times - times**2)[:, None], np.full((101, 1), inputs))


def test_differences_are_derivatives_of_a_parabola() -> None:
    recording = parabola()
    assert recording.acceleration == pytest.approx(-2.0)
    assert recording.velocity[0] == pytest.approx(2.0 - 2.0 * STEP)
    assert recording.starting_velocity == pytest.approx([2.0])
    assert recording.kinks == 0


def test_motion_without_events_is_one_piece() -> None:
    motion = Motion.of([parabola(), parabola()], 0)
    assert motion.unit == pytest.approx(2.0)
    assert [(p.recording, p.start, p.stop) for p in motion.pieces] == [(0, 0, 99), (1, 0, 99)]
    assert all(smooth.all() for smooth in motion.is_smooth)


def test_pieces_end_at_events_and_where_inputs_switch() -> None:
    inputs = driven(1)[0]
    recording = PUCK.solve(inputs)
    pieces = Motion.of([recording], 0).pieces
    bounces = [
        k
        for k in range(2, len(recording.outputs) - 2)
        if abs(recording.outputs[k + 1] - 2 * recording.outputs[k] + recording.outputs[k - 1]) > 0.002
    ]
    switches = CELL * (1 + np.flatnonzero(np.diff(inputs))) / STEP
    for at in [*bounces, *switches]:
        assert not any(p.start + 2 < at < p.stop - 1 for p in pieces)
    assert sum(p.stop - p.start for p in pieces) > 0.8 * len(recording.outputs)


def test_what_rests_has_no_events() -> None:
    recording = Recording(STEP, np.full((50, 2), 7.0), np.zeros((50, 0)))
    assert recording.kinks == 0
    assert len(Motion.of([recording], 1).pieces) == 1
