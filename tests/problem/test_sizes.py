import pytest

from falsifier.errors import SpecError
from falsifier.problem.sizes import MAX_STEPS, check_steps


def test_steps_up_to_the_limit_are_taken() -> None:
    check_steps(10.0, None, file="a.toml", key="k")
    check_steps(10.0, 10.0 / MAX_STEPS, file="a.toml", key="k")


@pytest.mark.parametrize(("stop_time", "period"), [(10.0, 1e-7), (1e18, 0.01), (1e308, 1e-300)])
def test_more_steps_are_refused_with_the_smallest_period(stop_time: float, period: float) -> None:
    with pytest.raises(
        SpecError, match=r"a\.toml: k: .* more than 10,000,000 steps .* smallest value"
    ) as error:
        check_steps(stop_time, period, file="a.toml", key="k")
    smallest = float(str(error.value).rpartition(" ")[2])
    check_steps(stop_time, smallest * 1.000001, file="a.toml", key="k")
