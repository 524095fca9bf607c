import pytest

from falsifier.stl import Verdict


@pytest.mark.parametrize(
    ("robustness", "violated"), [(-1e-300, True), (0.0, False), (-0.0, False), (1.0, False)]
)
def test_only_a_negative_margin_is_a_violation(robustness: float, violated: bool) -> None:
    assert Verdict(robustness, 0.0, "x <= 1").violated is violated
