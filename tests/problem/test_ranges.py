import pytest

from falsifier.core.model import Variable
from falsifier.errors import SpecError
from falsifier.problem.ranges import input_range
from falsifier.problem.spec import InputSection


def test_a_range_that_nobody_knows_must_be_given() -> None:
    with pytest.raises(SpecError, match=r"say --input u=LOW:HIGH\[:POINTS\]"):
        input_range(Variable("u"), InputSection(control_points=3), file="my.toml", key="inputs.u")
