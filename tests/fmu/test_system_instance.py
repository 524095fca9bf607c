"""All components of a system start again together, in the way that all of them can."""

from pathlib import Path

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu.buffers import Room
from falsifier.fmu.opening import open_session, unpack
from falsifier.fmu.plan import make_plan
from falsifier.fmu.systems.system import _order
from falsifier.fmu.worker_order import Reuse
from tests.fmu.small_systems import system


@pytest.mark.parametrize(
    ("components", "reuse"),
    [
        ({"a": "Plant_2", "b": "Gain_3"}, "reset"),
        ({"a": "Plant_2", "b": "SavedState_2"}, "state"),
        ({"a": "Lag_2", "b": "SavedState_2"}, "instance"),
        ({"a": "Plant_2", "b": "NoReset_2"}, "instance"),
        ({"a": "Plant_2", "b": "KeepsStatic_2"}, "library"),
    ],
)
def test_the_cheapest_way_that_suits_all_components_is_found(
    components: dict[str, str], reuse: Reuse, tmp_path: Path
) -> None:
    model = system(components, {})
    order = _order(model, logging=False)
    unpack(order, tmp_path)
    session = open_session(order, tmp_path, lambda _: None)
    plan = make_plan(order.description, Experiment(0.2, 0.1, ("a.y", "b.y")), [], [])
    room = Room.over(plan, np.zeros(Room.size(plan)))
    session.prepare(plan, room)
    session.run()
    first = room.outputs.copy()
    found = session.find_reuse()
    assert found == reuse
    for _ in range(2):
        room.outputs[:] = 0.0
        session.run()
        np.testing.assert_array_equal(room.outputs, first)
    session.close()
