import pytest

from falsifier.errors import SpecError
from falsifier.problem.options import changes_from_options


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("throttle=", "expected NAME="),
        ("=0:1", "expected NAME="),
        ("throttle=0:x", "'x' is not a number"),
        ("throttle=0:1:many", "not a number of control points"),
        ("throttle=0:1:3:cubic", "Known: pchip, linear, constant"),
        ("throttle=1:0:3", "low < high"),
    ],
)
def test_options_that_cannot_be_read_are_named(option: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        changes_from_options(inputs=[option])
