import pytest

from falsifier.errors import SpecError
from falsifier.fmu.ssp.markup import Value, parse_mappings, parse_structure, parse_values
from tests.fmu.packages import FEEDBACK, NAMESPACES, PI, PLANT, structure, system, values


def test_a_structure_is_read_as_it_is_written() -> None:
    text = structure(
        system(PLANT + PI, FEEDBACK), after='<ssd:DefaultExperiment startTime="1" stopTime="5"/>'
    )
    found = parse_structure(text.encode(), "a.ssd")
    assert [p.name for p in found.root.parts] == ["plant", "pi"]
    assert [c.kind for c in found.root.parts[0].connectors] == ["input", "output", "parameter"]
    assert found.root.wires[1].start == ("pi", "measured")
    assert (found.start_time, found.stop_time) == (1.0, 5.0)


def test_values_have_the_types_of_both_versions() -> None:
    text = values("a Real 1.5 m", "b Boolean true", "c UInt8 7", "d String x", "e Enumeration up")
    assert parse_values(text.encode(), "p.ssv") == (
        Value("a", 1.5, False, "m"),
        Value("b", 1.0, False, ""),
        Value("c", 7.0, False, ""),
        Value("d", "x", False, ""),
        Value("e", "up", True, ""),
    )


@pytest.mark.parametrize("value", ["NaN", "INF", "x"])
def test_numbers_that_are_none_are_refused(value: str) -> None:
    with pytest.raises(SpecError, match=r"^p\.ssv: "):
        parse_values(values(f"a Real {value}").encode(), "p.ssv")


def test_a_missing_attribute_is_named() -> None:
    text = f'<ssm:ParameterMapping {NAMESPACES}><ssm:MappingEntry source="a"/></ssm:ParameterMapping>'
    with pytest.raises(SpecError, match=r"^m\.ssm: the attribute 'target' is missing"):
        parse_mappings(text.encode(), "m.ssm")
