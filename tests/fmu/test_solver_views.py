import numpy as np

from falsifier.fmu.solver_memory import make_memory
from falsifier.fmu.solver_row import fill, make_row
from falsifier.fmu.solver_views import memory_of, model_of
from tests.fmu.test_solver_row import model


def test_compiled_code_sees_what_was_filled_in() -> None:
    row, filled, memory = make_row(), model(3), make_memory(3, 2, 3)
    arrays: dict[str, np.ndarray] = memory._asdict()
    for k, array in enumerate(arrays.values()):
        array[...] = np.arange(array.size).reshape(array.shape) + k
    fill(row, filled, memory)
    found = model_of(row.ctypes.data)
    for field in filled._fields:
        np.testing.assert_array_equal(getattr(found, field), getattr(filled, field), err_msg=field)
    for field, array in memory_of(row.ctypes.data, found)._asdict().items():
        own = arrays[field]
        np.testing.assert_array_equal(array, own, err_msg=field)
        assert array.dtype == own.dtype and array.ctypes.data == own.ctypes.data
