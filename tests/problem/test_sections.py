import pytest
from pydantic import ValidationError

from falsifier.problem.sections import InputSection, ParameterSection, RequirementSection, RiseSection


def test_sections_take_no_unknown_keys() -> None:
    for section in (InputSection, ParameterSection, RequirementSection):
        with pytest.raises(ValidationError, match="extra_forbidden"):
            section.model_validate({"formula": "G[0,1] (y <= 1)", "colour": "red"})


def test_a_range_is_in_order_and_excludes_a_value() -> None:
    with pytest.raises(ValidationError, match=r"expected \[low, high\] with low < high, got \[2, 1\]"):
        InputSection(range=(2.0, 1.0))
    with pytest.raises(ValidationError, match="value keeps the input constant"):
        InputSection(range=(0.0, 1.0), value=0.5)


def test_a_template_is_a_requirement_with_changes_of_its_own() -> None:
    section = RiseSection.model_validate(
        {"template": "rise", "signal": "y", "reference": 10, "time": 2, "stop_time": 5.0}
    )
    assert (section.signal, section.stop_time) == ("y", 5.0)
