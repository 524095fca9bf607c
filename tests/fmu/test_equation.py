"""What a library says of itself as a differential equation, before anything is solved."""

from typing import Any

import pytest

from falsifier.errors import ModelError
from falsifier.fmu.description.model_description import describe
from falsifier.fmu.equation import Equation
from falsifier.fmu.plan import Plan
from tests.fmu.fixtures import path

PLAN = Plan((), (), (), 1.0, 2, 1, 1, 0.1, None, 1.0)


class _Library:
    """A library that reports sizes without being loaded."""

    component = 0

    def __init__(self, size: int, status: int = 0) -> None:
        self._size, self._status = size, status

    def address(self, name: str) -> int:
        return len(name)

    def function(self, _name: str, *_types: object) -> Any:
        import ctypes

        def report(_component: int, address: int) -> int:
            ctypes.c_size_t.from_address(address).value = self._size
            return self._status

        return report


def equation(name: str, library: _Library) -> Equation:
    from falsifier.fmu.description.archive import file_hash

    fmu = path(name)
    return Equation(describe(fmu, file_hash(fmu)), library, PLAN, lambda *_: None)  # type: ignore[arg-type]


def test_sizes_are_those_of_the_description_and_from_fmi_3_on_those_of_the_library() -> None:
    found = equation("Ball_2", _Library(7))
    assert (found.states, found.indicators) == (2, 1)
    found = equation("Ball_3", _Library(7))
    assert (found.states, found.indicators) == (7, 7)


def test_sizes_that_cannot_be_are_refused() -> None:
    with pytest.raises(ModelError, match=r"Ball: 100001 continuous states; expected 0 to 100000"):
        equation("Ball_3", _Library(100_001))
    with pytest.raises(ModelError, match=r"Ball: GetNumberOfContinuousStates failed"):
        equation("Ball_3", _Library(1, 3))
