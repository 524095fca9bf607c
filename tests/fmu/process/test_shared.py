import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu.description import read_description
from falsifier.fmu.process.plan import Plan, make_plan
from falsifier.fmu.process.room import HEADER, Room
from tests.fmu import fixtures

LAG = read_description(fixtures.path("Lag_2"))


def plan(inputs: list[str], parameters: list[str], outputs: tuple[str, ...], pieces: int = 4) -> Plan:
    return make_plan(LAG, Experiment(1.0, 0.1, outputs), inputs, parameters, pieces=pieces)


@pytest.mark.parametrize(
    ("made", "size"),
    [
        (plan(["u"], ["gain", "T"], ("x", "y")), 2 + 1 * 4 * 5 + 2 * 11),
        (plan([], [], ("y",)), 11),
        (plan(["u"], [], ()), 20),
    ],
)
def test_the_arrays_fill_the_memory_without_gaps_or_overlaps(made: Plan, size: int) -> None:
    assert Room.size(made) == HEADER + size
    memory = np.zeros(HEADER + size)
    room = Room.over(made, memory)
    for array in (room.header, room.parameters, room.inputs, room.outputs):
        array += 1.0
    assert memory.tolist() == [1.0] * (HEADER + size)


def test_rows_are_inputs_and_outputs() -> None:
    made = plan(["u"], ["gain"], ("x", "y"))
    room = Room.over(made, np.zeros(Room.size(made) + 7))  # shared memory may be larger
    assert (room.parameters.shape, room.inputs.shape, room.outputs.shape) == ((1,), (1, 20), (2, 11))
