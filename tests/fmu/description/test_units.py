from xml.etree import ElementTree

import pytest

from falsifier.fmu.description.units import Unit, conversion, read_units

UNITS = """<x><UnitDefinitions>
  <Unit name="furlong"><BaseUnit m="1" factor="201.168"/></Unit>
  <Unit name="degX"><BaseUnit K="1" factor="2" offset="100"/></Unit>
  <Unit name="bogus"/>
</UnitDefinitions></x>"""


def test_units_are_read_as_the_fmu_defines_them() -> None:
    found = read_units(ElementTree.fromstring(UNITS))
    assert found == {
        "furlong": Unit((0, 1, 0, 0, 0, 0, 0, 0), 201.168),
        "degX": Unit((0, 0, 0, 0, 1, 0, 0, 0), 2.0, 100.0),
    }


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [
        ("m", "m", 3.0, 3.0),
        ("furlong", "m", 1.0, 201.168),
        ("m", "furlong", 402.336, 2.0),
        ("degX", "K", 10.0, 120.0),
        ("K", "degX", 120.0, 10.0),
        ("degX", "degC", 10.0, -153.15),
        ("km/h", "m/s", 36.0, 10.0),
        ("", "m", 3.0, 3.0),
        ("m", "", 3.0, 3.0),
        ("bogus", "bogus", 3.0, 3.0),
    ],
)
@pytest.mark.parametrize("definer", [0, 1])
def test_values_are_converted_whichever_fmu_defines_the_unit(
    source: str, target: str, value: float, expected: float, definer: int
) -> None:
    known = read_units(ElementTree.fromstring(UNITS))
    found = conversion(source, target, (known, {}) if definer == 0 else ({}, known))
    assert found is not None
    assert found[0] * value + found[1] == pytest.approx(expected)


@pytest.mark.parametrize(("source", "target"), [("m", "s"), ("bogus", "m"), ("m", "bogus"), ("V", "N")])
def test_what_cannot_be_converted_is_not(source: str, target: str) -> None:
    assert conversion(source, target, ({}, {})) is None
