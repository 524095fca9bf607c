from typing import Any

import pytest

from falsifier.errors import SpecError
from falsifier.problem.spec import parse_spec


@pytest.mark.parametrize(
    ("requirement", "key"),
    [
        ({"template": "order", "conditions": ["a", "b"], "inputs": {"u": {"rang": [0, 1]}}}, "inputs.u.rang"),
        ({"formula": "G (x <= 1)", "inputs": {"u": {"range": [1, 0]}}}, "inputs.u"),
        ({"template": "order", "conditions": ["a", "b ="]}, "conditions.1"),
        ({}, "formula"),
    ],
)
def test_keys_are_those_of_the_file_whatever_kind_a_requirement_is(
    requirement: dict[str, Any], key: str
) -> None:
    data = {"model": {"fmu": "a.fmu"}, "requirements": {"<formula>x": requirement}}
    with pytest.raises(SpecError) as raised:
        parse_spec(data, file="my.toml")
    assert raised.value.key == f"requirements.<formula>x.{key}"
