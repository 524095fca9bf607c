import ctypes

import numpy as np

from falsifier.fmu import stepping
from falsifier.fmu.c_functions import call_signature


def test_the_next_number_is_that_of_numpy() -> None:
    for number in (0.0, 1.0, 1.5, 1e-300, 2.0**52, 1e300, 0.1):
        assert stepping.spacing(number) == np.spacing(number)


def test_a_status_has_no_sign() -> None:
    signature, _ = call_signature("ppndib")
    assert str(signature) == "(int64, int64, int64, int64, float64, int32, uint8) -> uint32"
    assert ctypes.sizeof(ctypes.c_size_t) == 8
