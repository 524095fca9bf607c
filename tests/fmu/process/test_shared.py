import os

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.fmu.description import read_description
from falsifier.fmu.process.plan import Plan, make_plan
from falsifier.fmu.process.shared import _DROPPED, _MOST_BYTES, HEADER, Output, Room
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


def prints(output: Output, text: bytes) -> int:
    return os.write(output.fileno(), text)


def test_lines_are_taken_once() -> None:
    output = Output()
    assert output.take() == ()
    prints(output, b"one\ntwo")
    assert output.take() == ("one", "two")
    assert output.take() == ()
    prints(output, b"three\n")
    assert output.take() == ("three",)
    output.close()


def test_of_much_output_the_end_is_taken() -> None:
    output = Output()
    prints(output, b"first\n" + b"x" * 100_000 + b"\nlast\n")
    lines = output.take()
    assert lines[-1] == "last"
    assert "first" not in lines
    output.close()


def test_no_process_can_make_it_longer_or_shorter() -> None:
    output = Output()
    written = 0
    with pytest.raises(PermissionError):
        while True:
            written += prints(output, b"x" * 99_999)
    assert written == _MOST_BYTES
    for size in (0, 2 * _MOST_BYTES):
        with pytest.raises(PermissionError):
            os.ftruncate(output.fileno(), size)
    assert output.take()[-1] == _DROPPED
    prints(output, b"again\n")
    assert output.take() == ("again",)
    output.close()


@pytest.mark.parametrize("position", [1, _MOST_BYTES, 1 << 60])
def test_a_moved_position_does_no_harm(position: int) -> None:
    output = Output()
    os.lseek(output.fileno(), position, os.SEEK_SET)
    assert sum(map(len, output.take())) < _MOST_BYTES
    prints(output, b"again\n")
    assert output.take() == ("again",)
    output.close()


def test_what_a_terminal_would_act_on_is_removed() -> None:
    output = Output()
    prints(output, b"\x1b]0;title\x07\x1b[31mred\xff\n")
    assert output.take() == ("red\ufffd",)
    output.close()
