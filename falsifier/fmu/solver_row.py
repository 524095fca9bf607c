"""A row of eight-byte numbers with all that the solver works on, for machine code that takes one address."""

from collections.abc import Iterable

import numpy as np

from falsifier.fmu.ports import Table
from falsifier.fmu.solver_memory import Floats, Memory, Model

# The functions of the model, four addresses or sizes of each table of inputs, the addresses of their pieces,
# and sizes.
FUNCTIONS, PORTS, HELD_PORTS = 0, 11, 15
PIECES, HELD_PIECES, COUNT, STATES, INDICATORS = range(19, 24)
# The addresses of the weights, of the fields of Memory in their order, and of what a component keeps.
WEIGHTS, MEMORY, KEPT = 24, 25, 39
TOLERANCE, STOP_TIME, MAX_STEP = range(40, 43)
# Of a component: FMI status, and whether the FMU ends the simulation.
SOLVER_STATUS, SOLVER_ENDS = 43, 44
# Of a single FMU: recorded variables, address and length of the rows to record to, solver steps to do.
GETTERS, OUTPUTS, SAMPLES, STEPS, WIDTH = 45, 49, 50, 51, 52


def make_row() -> Table:
    """Return a row of zeros."""
    return np.zeros(WIDTH, dtype=np.int64)


def fill(row: Table, model: Model, memory: Memory) -> None:
    """Write a model and a memory, which must outlive the row's use, to a row."""
    numbers = row.view(np.float64)
    row[FUNCTIONS:PORTS] = model.functions
    row[PORTS:HELD_PORTS] = model.ports
    row[HELD_PORTS:PIECES] = model.held_ports
    row[PIECES], row[HELD_PIECES], row[COUNT] = model.pieces[0], model.held_pieces[0], model.pieces[1]
    row[STATES], row[INDICATORS] = len(memory.x), len(memory.z)
    row[WEIGHTS:KEPT] = list(_addresses((model.weights, *memory)))
    numbers[TOLERANCE], numbers[STOP_TIME] = model.tolerance, model.stop_time
    numbers[MAX_STEP] = model.max_step
    row[GETTERS:OUTPUTS] = model.getters


def record_to(row: Table, outputs: Floats) -> None:
    """Write to a row where to record to: contiguous rows, shape (outputs, samples)."""
    row[OUTPUTS], row[SAMPLES] = outputs.ctypes.data, outputs.shape[1]


def _addresses(arrays: Iterable[np.ndarray]) -> Iterable[int]:
    return (array.ctypes.data for array in arrays)
