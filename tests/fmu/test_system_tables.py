from pathlib import Path

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu import Component
from falsifier.fmu import coupled_stepping as loops
from falsifier.fmu.buffers import Room
from falsifier.fmu.description import archive
from falsifier.fmu.instance import FmuInstance
from falsifier.fmu.plan import make_plan
from falsifier.fmu.system_tables import SystemTables
from tests.fmu.small_systems import LOOP, component, run, solved, system


def test_rows_are_in_the_order_of_stepping_and_connected_outputs_are_copied(tmp_path: Path) -> None:
    network = system({"pi": "Gain_3", "plant": component("Plant_2", 0.2)}, LOOP).network
    parts = []
    for member in network.members:
        archive.extract(member.path, tmp_path / member.folder)
        parts.append(
            FmuInstance(member.description, tmp_path / member.folder, "co-simulation", lambda _: None)
        )
    plan = make_plan(network.description, Experiment(1.0, 0.1, ("plant.x", "plant.y")), ["pi.r"], [])
    room = Room.over(plan, np.zeros(Room.size(plan)))
    tables = SystemTables(network, parts, plan, room)
    assert tables.titles == ["plant.y", "pi.y"]
    assert tables.components[:, loops.EVERY].tolist() == [2, 1]
    assert tables.components[:, loops.FUNCTIONS + 5].tolist() == [2, 3], "FMI versions"
    counts = {
        name: tables.components[:, column + 3].tolist()
        for name, column in (("inputs", loops.PLAIN), ("sources", loops.SOURCES), ("rest", loops.RECORDED))
    }
    assert counts == {"inputs": [1, 2], "sources": [1, 1], "rest": [1, 0]}
    assert tables.copies[:, 1].tolist() == [room.outputs[1:].ctypes.data], "plant.y, not plant.x"
    tables.signals[:] = 7.0
    tables.start_again()
    assert (tables.signals[:, loops.TIME] == -1.0).all(), "nothing is known yet"
    for part in parts:
        part.close()


@pytest.mark.parametrize("arrays", ["Arrays_3", solved("Arrays_3")])
def test_a_fixed_element_stays_if_another_one_is_connected(arrays: str | Component) -> None:
    """x1' = x2 + u1, x2' = -x1 + u2 from rest, with u1 = 2 from the other component."""
    model = system({"a": arrays, "pi": "Gain_2"}, {"a.u[1]": "pi.y"})
    got = run(model, "a.x[1]", parameters={"a.u[2]": 3.0})
    exact = 2.0 * np.sin(got.times) + 3.0 * (1.0 - np.cos(got.times))
    np.testing.assert_allclose(got["a.x[1]"], exact, atol=1e-6)
