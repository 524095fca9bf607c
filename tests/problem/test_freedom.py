import pytest

from falsifier.problem.freedom import default_freedom, smallest_window
from falsifier.problem.problem import Problem
from falsifier.stl import parse
from tests.fmu.fixtures import path as fmu_path


@pytest.mark.parametrize(
    ("formula", "stop_time", "step", "count", "shortest"),
    [
        ("G[0,50] (y <= 1)", 50.0, 0.01, 200, 0.25),  # no small window: a share of the stop time
        ("G (u >= 1 -> F[0,1] (y <= 1))", 50.0, 0.01, 500, 0.1),  # ten pieces per window
        ("G (F[0,0.02] (y <= 1))", 50.0, 0.01, 1000, 0.05),  # never more than a thousand
        ("G (F[0,0.2] (y <= 1))", 1.0, 0.1, 10, 0.1),  # never shorter than the step
        ("G[2,2] (y <= 1)", 10.0, 0.01, 200, 0.05),  # a moment is no window
        ("not a formula", 10.0, 20.0, 1, 20.0),
    ],
)
def test_the_limits_follow_from_windows_step_and_stop_time(
    formula: str, stop_time: float, step: float, count: int, shortest: float
) -> None:
    free = default_freedom([formula], stop_time=stop_time, step=step)
    assert (free.max_control_points, free.min_interval) == (count, shortest)


def test_the_smallest_window_of_several_formulas_counts() -> None:
    assert smallest_window([parse("G[0,5] (F[1,3] (y <= 1))"), "G[0,1] (y <= 1)"]) == 1.0
    assert smallest_window(["G (y <= 1)"]) is None


def lag(**inputs: object) -> Problem:
    return Problem.from_fmu(
        fmu_path("Lag_2"),
        "G[0,9] (F[0,1] (y <= 1))",
        inputs=inputs,  # type: ignore[arg-type]
        stop_time=10.0,
    )


def test_control_points_that_nobody_stated_are_free() -> None:
    (u,) = lag(u=(-1, 1)).space.inputs
    assert u.free is not None
    assert (u.free.max_control_points, u.free.min_interval) == (200, 0.05)
    assert lag().space.inputs[0].free == u.free, "all bounded inputs"


def test_control_points_that_were_stated_are_fixed() -> None:
    for choice in ((-1, 1, 5), (-1, 1, 5, "linear")):
        (u,) = lag(u=choice).space.inputs
        assert u.free is None
