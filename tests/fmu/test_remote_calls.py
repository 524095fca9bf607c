"""Calls between processes; whole simulations are in test_remote_component.py."""

import ctypes
import sys
import threading

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.fmu import remote_calls as calls
from falsifier.fmu.library import TYPES

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked, and end with a parent")


def box() -> NDArray[np.int64]:
    """A box with the functions to wait with, whose process is nobody's child."""
    words = np.zeros(calls.DATA + 100, dtype=np.int64)
    libc = ctypes.CDLL(None)
    for word, name in (
        (calls.NANOSLEEP, "nanosleep"),
        (calls.YIELD, "sched_yield"),
        (calls.WAITPID, "waitpid"),
    ):
        words[word] = ctypes.cast(getattr(libc, name), ctypes.c_void_p).value or 0
    words[calls.PID] = 1
    return words


def test_the_functions_of_a_version_have_places_of_their_own_in_the_box() -> None:
    for version, kinds in TYPES.items():
        if version > 1:
            names = calls.names(version)
            assert len(set(names)) == len(names) <= calls.DATA - calls.FUNCTIONS
            assert {f"Set{kind}" for kind in kinds} < set(names)


def test_a_call_is_made_by_the_other_side() -> None:
    """Here by a thread; waitpid always says that the process is there."""
    words = box()
    address = words.ctypes.data
    is_there = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_int)(lambda *_: 0)
    words[calls.WAITPID] = ctypes.cast(is_there, ctypes.c_void_p).value or 0
    status = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(lambda instance: 1 if instance == 77 else 3)
    number = calls.names(3).index("EnterStepMode")
    words[calls.FUNCTIONS + number] = ctypes.cast(status, ctypes.c_void_p).value or 0
    other = threading.Thread(target=calls.serve, args=(address, 77, 3))
    other.start()
    call = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(calls.stand_in("EnterStepMode", 3).address)
    assert call(address) == 1
    calls.ask_other(address)
    other.join()
    assert words[calls.REPLIES] == 1 and words[calls.REQUESTS] == 2


def test_a_call_to_a_process_that_has_ended_is_fatal() -> None:
    words = box()
    call = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(calls.stand_in("EnterStepMode", 3).address)
    assert [call(words.ctypes.data) for _ in range(2)] == [4, 4]
    assert words[calls.IS_GONE] == 1
