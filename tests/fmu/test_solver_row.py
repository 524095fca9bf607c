"""A row has the model's numbers and the addresses of the arrays, and compiled code finds them there."""

import numpy as np

from falsifier.fmu import solver_row
from falsifier.fmu.solver_memory import Model, make_memory
from falsifier.fmu.solver_row import fill, make_row, record_to


def model(states: int) -> Model:
    return Model(
        functions=tuple(range(1, 12)),
        ports=(21, 22, 23, 1),
        held_ports=(31, 32, 33, 2),
        getters=(41, 42, 43, 5),
        pieces=(51, 6),
        held_pieces=(61, 6),
        weights=np.arange(float(states)),
        tolerance=1e-6,
        stop_time=2.0,
        max_step=0.25,
    )


def test_columns_do_not_overlap() -> None:
    row, outputs = make_row(), np.zeros((5, 9))
    found, memory = model(3), make_memory(3, 2, 3)
    fill(row, found, memory)
    record_to(row, outputs)
    numbers = row.view(np.float64)
    assert row[: solver_row.PIECES].tolist() == [*range(1, 12), 21, 22, 23, 1, 31, 32, 33, 2]
    assert row[solver_row.PIECES : solver_row.WEIGHTS].tolist() == [51, 61, 6, 3, 2]
    addresses = [array.ctypes.data for array in (found.weights, *memory)]
    assert row[solver_row.WEIGHTS : solver_row.KEPT].tolist() == addresses
    assert numbers[solver_row.TOLERANCE : solver_row.MAX_STEP + 1].tolist() == [1e-6, 2.0, 0.25]
    assert row[solver_row.GETTERS : solver_row.OUTPUTS].tolist() == [41, 42, 43, 5]
    assert row[solver_row.OUTPUTS : solver_row.STEPS].tolist() == [outputs.ctypes.data, 9]
    others = [solver_row.KEPT, solver_row.SOLVER_STATUS, solver_row.SOLVER_ENDS, solver_row.STEPS]
    assert not row[others].any()
