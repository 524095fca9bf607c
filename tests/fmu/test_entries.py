"""What enters the loops agrees with what packs their arguments."""

import inspect

import pytest

from falsifier.fmu import entries, loops, stepping
from falsifier.fmu.machine_code import SOURCES


def test_each_entry_has_sources_and_takes_what_to_do_and_an_address() -> None:
    for name in SOURCES:
        assert len(inspect.signature(getattr(entries, name)).parameters) == 2


@pytest.mark.parametrize("name", ["co_simulate", "read_row", "write_row", "enter_step_mode", "put", "fetch"])
def test_a_loop_takes_the_same_arguments_from_python_and_from_compiled_code(name: str) -> None:
    called, compiled = getattr(loops, name), getattr(stepping, name).py_func
    arguments = [a for a in inspect.signature(compiled).parameters if a != "report"]  # it is returned
    assert list(inspect.signature(called).parameters) == arguments


def test_without_a_step_to_do_nothing_is_called() -> None:
    table = (0, 0, 0, 0)
    report = loops.co_simulate((0,) * 7, table, (0, 0), table, (0, 0), 0, 0, table, 0, 0, 1.0, 10, 4, 4, 1)
    assert report == (0, loops.DONE, 4)
