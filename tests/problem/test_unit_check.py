from pathlib import Path

import pytest

from falsifier.core.model import ModelInfo, Variable
from falsifier.fmu import FmuModel, System
from falsifier.fmu.description.structure import Unit
from falsifier.problem.unit_check import defined_units, factor_and_offset, unit_conflicts
from falsifier.stl import parse
from falsifier.testing import lag_problem
from tests.fmu.fixtures import altered, path as fixture
from tests.problem.support import AT

UNITS_OF = {
    "v": "km/h", "w": "mph", "s": "m", "t": "m", "n": "1", "q": "zork", "z": "span", "u": "1/min", "r": "rpm",
    "n1": "rad/s", "K": "K", "C": "degC",
}  # fmt: skip
INFO = ModelInfo("car", variables=tuple(Variable(name, unit=unit) for name, unit in UNITS_OF.items()))
# As the FMU defines it: ten metres.
UNITS = {"span": Unit((0, 1, 0, 0, 0, 0, 0, 0), 10.0)}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("G (v <= w)", "w in mph; convert one of them: w in km/h is 1.60934 times it"),
        ("G (v + s <= 3)", "v is in km/h, s in m; compare or add"),
        ("G (abs(v - s) <= 3)", "v is in km/h, s in m"),
        ("G (min(v, s) <= 3)", "v is in km/h, s in m"),
        ("G (v <= -s)", "-s in m"),
        ("G (u <= n1)", "convert one of them: n1 in 1/min is 9.5493 times it"),
        ("G (K <= C)", "C in degC; convert one of them: C in K is 1 times it + 273.15"),
        ("G (C <= K)", "K in K; convert one of them: K in degC is 1 times it - 273.15"),
        ("G (z <= s)", "convert one of them: s in span is 0.1 times it"),
    ],
)
def test_units_that_do_not_fit_are_named(text: str, message: str) -> None:
    found = list(unit_conflicts(parse(text), INFO, UNITS))
    assert len(found) == 1
    assert message in found[0][1]


FITTING = [
    "v <= 3",
    "s - t <= 3",
    "n <= v",
    "3.6*s <= v",
    "v/s <= w",
    "v^2 <= s",
    "v == v",
    "unknown <= v",
    "K - 273.15 <= C",
]


@pytest.mark.parametrize("text", [*FITTING, "q <= s", "u <= r"])
def test_what_may_fit_is_no_conflict(text: str) -> None:
    assert not list(unit_conflicts(parse(text), INFO, UNITS))


@pytest.mark.parametrize(
    ("one", "other", "factor"),
    [
        ("percent", "%", 1.0),
        ("MPH", "mph", 1.0),
        ("U/min", "rev/min", 1.0),
        ("1/min", "rpm", 1.0),
        ("km/h", "MPH", 0.621371),
        ("Nm", "N.m", 1.0),
        ("span", "m", 10.0),
    ],
)
def test_units_are_known_by_what_people_write(one: str, other: str, factor: float) -> None:
    assert factor_and_offset(one, other, UNITS) == pytest.approx((factor, 0.0), rel=1e-6)
    assert factor_and_offset("T", "t", UNITS) is None, "the case of short units counts"


def test_fmus_define_units_and_other_models_do_not() -> None:
    assert "mph" in defined_units(FmuModel(AT))
    assert defined_units(lag_problem().model) == {}


def test_a_system_has_the_units_of_its_fmus_unless_they_differ(tmp_path: Path) -> None:
    other = altered(fixture("Gain_2mm"), tmp_path / "other.fmu", lambda x: x.replace(b'r="0.001"', b'r="9"'))
    one, both = ({"a": AT, "b": fixture("Gain_2mm")}, {"b": fixture("Gain_2mm"), "c": other})
    known = defined_units(System(one))
    assert known["mm"] == defined_units(FmuModel(fixture("Gain_2mm")))["mm"] and "mph" in known
    assert set(defined_units(System(both))) == {"m"}
