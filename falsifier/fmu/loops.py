"""The compiled loops as functions for Python; their machine code is loaded when one is first called.

Names, arguments and results are those of ``stepping`` and, for the solver, of ``continuous`` and ``solver``.
"""

import ctypes
import threading
from struct import Struct

from falsifier.fmu import loop_numbers, machine_code
from falsifier.fmu.loop_numbers import (
    CALL_BYTES,
    DONE,
    EVENT,
    GETTING,
    PAUSED,
    PIECE_BYTES,
    PLACE_BYTES,
    SETTING,
    STEPPING,
    STUCK,
    TERMINATED,
    TOO_SMALL,
)
from falsifier.fmu.ports import Addresses, Table
from falsifier.fmu.solver_row import STEPS

__all__ = [
    "CALL_BYTES",
    "DONE",
    "EVENT",
    "GETTING",
    "PAUSED",
    "PIECE_BYTES",
    "PLACE_BYTES",
    "SETTING",
    "STEPPING",
    "STUCK",
    "TERMINATED",
    "TOO_SMALL",
    "advance",
    "co_simulate",
    "enter_step_mode",
    "fetch",
    "put",
    "read_row",
    "refresh",
    "settle",
    "write_row",
]

# What ``entries.co_simulation`` reads.
_FUNCTIONS, _ROW, _NUMBER = Struct("=7q"), Struct("=9q"), Struct("=qd")
_CO_SIMULATION = Struct("=7q4q2q4q2q2q4q2q5qd")


class _Report(threading.local):
    """What each thread's loops report."""

    def __init__(self) -> None:
        self.memory = (ctypes.c_int64 * 3)()
        self.address = ctypes.addressof(self.memory)


_REPORT = _Report()


def write_row(instance: int, version: int, ports: Addresses, numbers: int) -> int:
    """Set all variables of a table to the float64 numbers at this address; return the FMI status."""
    packed = _ROW.pack(instance, version, *ports, numbers, 0, 0)
    return machine_code.co_simulation()(loop_numbers.WRITE_ROW, packed)


def read_row(instance: int, version: int, ports: Addresses, rows: int, width: int, column: int) -> int:
    """Read all variables of a table into a column of the rows at this address; return the FMI status."""
    packed = _ROW.pack(instance, version, *ports, rows, width, column)
    return machine_code.co_simulation()(loop_numbers.READ_ROW, packed)


def put(place: int, number: float) -> None:
    """Write a number to a variable's location in a row of Ports.places."""
    machine_code.co_simulation()(loop_numbers.PUT, _NUMBER.pack(place, number))


def fetch(place: int) -> float:
    """Return a variable's value, read from its location in a row of Ports.places."""
    number = ctypes.c_double()
    packed = _ROW.pack(place, ctypes.addressof(number), *(0,) * 7)
    machine_code.co_simulation()(loop_numbers.FETCH, packed)
    return number.value


def enter_step_mode(functions: tuple[int, ...]) -> tuple[int, int]:
    """Leave the event mode in which FMI 3 initialisation ends; return status and where it stopped."""
    entry = machine_code.co_simulation()
    return _outcome(entry(loop_numbers.ENTER_STEP_MODE_FIRST, _FUNCTIONS.pack(*functions)))


def co_simulate(
    functions: tuple[int, ...],
    ports: Addresses,
    pieces: tuple[int, int],
    held_ports: Addresses,
    held_pieces: tuple[int, int],
    current: int,
    values: int,
    getters: Addresses,
    outputs: int,
    width: int,
    stop_time: float,
    steps: int,
    first: int,
    last: int,
    every: int,
) -> tuple[int, int, int]:
    """Do the communication steps first..last-1; see ``stepping.co_simulate``.

    Returns:
        FMI status, where it stopped, and number of completed steps.
    """
    packed = _CO_SIMULATION.pack(
        *functions, *ports, *pieces, *held_ports, *held_pieces, current, values, *getters, outputs, width,
        steps, first, last, every, _REPORT.address, stop_time,
    )  # fmt: skip
    machine_code.co_simulation()(loop_numbers.CO_SIMULATE, packed)
    status, where, done = _REPORT.memory
    return status, where, done


def settle(row: Table) -> tuple[int, int]:
    """Iterate events until nothing changes, enter continuous time; return status and where it stopped."""
    return _outcome(machine_code.model_exchange()(loop_numbers.SETTLE, row.ctypes.data))


def refresh(row: Table) -> tuple[int, int]:
    """Get derivatives and indicators at the current time and state; return status and where it stopped."""
    return _outcome(machine_code.model_exchange()(loop_numbers.REFRESH, row.ctypes.data))


def advance(row: Table, steps: int) -> tuple[int, int]:
    """Continue a simulation for at most this many solver steps; return status and where it stopped."""
    row[STEPS] = steps
    return _outcome(machine_code.model_exchange()(loop_numbers.ADVANCE, row.ctypes.data))


def _outcome(result: int) -> tuple[int, int]:
    where, status = divmod(result, 1 << 32)
    return status, where
