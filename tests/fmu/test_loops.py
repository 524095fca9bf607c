"""The compiled loops as Python calls them."""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from falsifier.fmu import loop_numbers, loops
from falsifier.fmu.process.encoding import STORAGE
from tests.fmu import plain

Status = Callable[..., int]


@pytest.mark.parametrize("kind", range(len(STORAGE)))
def test_values_of_all_types_are_put_and_fetched(kind: int) -> None:
    memory = np.zeros(1, dtype=STORAGE[kind])
    place = np.array([kind, memory.ctypes.data, 1, 0], dtype=np.int64)
    loops.put(place.ctypes.data, 2.75)
    assert memory[0] == (2.75 if STORAGE[kind].startswith("f") else 3)
    assert loops.fetch(place.ctypes.data) == plain.fetch(place.ctypes.data) == memory[0]


@pytest.mark.parametrize("version", [2, 3])
def test_rows_are_written_and_read_with_the_status_of_the_fmu(version: int) -> None:
    """A negative status, which FMI does not define, is larger than all others."""
    statuses, seen = [0, -1, 0], []

    def exchange(_instance: int, _references: int, count: int, values: int, *_size: int) -> int:
        seen.append(ctypes.c_double.from_address(values).value)
        assert count == 1
        return statuses.pop(0)

    arguments = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
    last = (ctypes.c_size_t,) if version == 3 else ()
    function = ctypes.CFUNCTYPE(ctypes.c_int, *arguments, *last)(exchange)
    value, numbers, rows = np.zeros(1), np.array([4.5]), np.zeros(3)
    address = ctypes.cast(function, ctypes.c_void_p).value
    calls = np.array([address, 0, 1, value.ctypes.data, 1], dtype=np.int64)
    places = np.array([0, value.ctypes.data, 1, 0], dtype=np.int64)
    table = (calls.ctypes.data, 1, places.ctypes.data, 1)
    assert loops.write_row(0, version, table, numbers.ctypes.data) == 0
    assert loops.write_row(0, version, table, numbers.ctypes.data) == 2**32 - 1
    assert loops.read_row(0, version, table, rows.ctypes.data, 3, 1) == 0
    assert seen == [4.5, 4.5, 4.5]
    assert rows.tolist() == [0.0, 4.5, 0.0]


@pytest.mark.parametrize(
    ("status", "where"), [(0, loops.DONE), (1, loops.DONE), (3, loops.EVENT), (-1, loops.EVENT)]
)
def test_the_first_event_mode_ends_with_a_status_and_where_it_stopped(status: int, where: int) -> None:
    update = ctypes.CFUNCTYPE(ctypes.c_int, *(ctypes.c_void_p,) * 7)(lambda *_: 0)
    enter = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(lambda _: status)
    addresses = [ctypes.cast(f, ctypes.c_void_p).value or 0 for f in (update, enter)]
    functions = [0] * 7
    functions[loop_numbers.UPDATE_DISCRETE_STATES], functions[loop_numbers.ENTER_STEP_MODE] = addresses
    assert loops.enter_step_mode(tuple(functions)) == (status % 2**32, where)
