from typing import Any

import pytest

from falsifier.core.model import Variable
from falsifier.core.space import InputRange
from falsifier.errors import SpecError
from falsifier.problem.ranges import fixed_value, input_range, parameter_range
from falsifier.problem.sections import InputSection


def test_a_range_that_nobody_knows_must_be_given() -> None:
    with pytest.raises(SpecError, match=r"or --search u=LOW:HIGH\[:POINTS\]"):
        input_range(Variable("u"), InputSection(control_points=3), file="my.toml", key="inputs.u")


GEAR = Variable("gear", "enumeration", "input", literals={"first": 1, "top": 3})


def searched(variable: Variable, **section: Any) -> InputRange:
    return input_range(variable, InputSection(control_points=3, **section), file="my.toml", key="inputs.x")


def test_range_unit_and_meaning_come_from_the_fmu() -> None:
    v = Variable("u", causality="input", low=-1.0, high=2.0, unit="V", description="drive")
    found = searched(v)
    assert (found.low, found.high, found.unit, found.description) == (-1.0, 2.0, "V", "drive")
    assert (found.interpolation, found.kind, found.free) == ("pchip", "real", None)
    narrowed = searched(v, range=(0, 1), interpolation="linear", hold=0.1)
    assert (narrowed.low, narrowed.high, narrowed.interpolation, narrowed.hold) == (0, 1, "linear", 0.1)


def test_whole_numbers_are_held_between_control_points() -> None:
    found = searched(GEAR)
    assert (found.low, found.high, found.interpolation) == (1, 3, "constant")
    assert (found.kind, found.items) == ("enumeration", (("first", 1), ("top", 3)))
    with pytest.raises(SpecError, match=r"inputs\.x\.interpolation"):
        searched(GEAR, interpolation="linear")


@pytest.mark.parametrize(
    ("variable", "limits", "key"),
    [
        (Variable("u", low=0.0, high=1.0), (0.0, 1.5), r"inputs\.x\.range"),
        (Variable("u", low=0.0), (-1.0, 5.0), r"inputs\.x\.range"),
        (Variable("n", "integer"), (0.2, 0.8), r"inputs\.x\.range"),
        (GEAR, (1.5, 2.5), r"inputs\.x\.range"),
        (GEAR, (0, 3), r"inputs\.x\.range"),
    ],
)
def test_ranges_that_a_variable_cannot_have_are_refused(
    variable: Variable, limits: tuple[float, float], key: str
) -> None:
    with pytest.raises(SpecError, match=f"my.toml: {key}"):
        searched(variable, range=limits)


def test_parameters_have_their_nominal_value() -> None:
    found = parameter_range(Variable("p", start=0.5, unit="kg"), (0.0, 1.0), file=None, key="parameters.p")
    assert (found.nominal, found.unit) == (0.5, "kg")
    unknown = parameter_range(Variable("p"), (0.0, 1.0), file=None, key="parameters.p")
    assert unknown.nominal is None
    with pytest.raises(SpecError, match="string"):
        parameter_range(Variable("p", "string"), (0.0, 1.0), file=None, key="parameters.p")


@pytest.mark.parametrize(
    ("variable", "value", "fits"),
    [
        (GEAR, 3, True),
        (GEAR, 2, False),
        (Variable("n", "integer"), 2.5, False),
        (Variable("x"), 2.5, True),
        (Variable("x", low=0.0), -3.0, False),
        (Variable("x", high=2.0), 2.5, False),
        (Variable("x", low=0.0, high=2.0), 2.0, True),
    ],
)
def test_a_fixed_value_must_be_one_that_the_variable_can_have(
    variable: Variable, value: float, fits: bool
) -> None:
    if fits:
        assert fixed_value(variable, value, file=None, key="inputs.x.value") == value
    else:
        with pytest.raises(SpecError, match=r"inputs\.x\.value"):
            fixed_value(variable, value, file=None, key="inputs.x.value")
