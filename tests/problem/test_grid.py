from pathlib import Path

import pytest

from falsifier.errors import SpecError
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.grid import check_steps, choose_grid, default_freedom, fitting_interval, formula_times
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import section_formulas
from falsifier.problem.sections import RequirementSection
from falsifier.stl import parse
from tests.fmu.fixtures import path as fmu_path
from tests.problem.support import echo


@pytest.mark.parametrize(
    ("stop", "times", "fmu_step", "internal_step", "interval"),
    [
        (3.0, [1.0], None, None, 0.002),  # not 0.003 s, of which 1 s is no multiple
        (50.0, [20.0], 0.01, None, 0.01),
        (10.0, [0.25], 0.1, None, 0.05),
        (1.0, [1 / 3], None, None, 1 / 1002),
        (0.7, [], 0.2, None, 0.1),
        (15.0, [], 1 / 30, None, 1 / 30),  # divides it but for rounding
        (10.0, [], 20.0, None, 0.01),  # longer than the simulation
        (50.0, [], 0.0, None, 0.05),
        (100.0, [200.0], None, None, 0.1),  # a time after the end is an error of the formula, not of the grid
        (2.0, [1.0], None, 0.25, 0.25),
        (10.0, [], None, 0.004, 0.008),  # a multiple, not 0.01 s
        (2.0, [1.1], None, 0.25, 0.002),
        (10.0, [], 0.1, 0.3, 0.1),  # the default experiment decides
        (10.5, [], 0.5, 0.25, 0.5),
        (10.0, [1.75], 1.0, 0.25, 0.25),  # also where that does not fit: 0.05 s would be refused
        (10.0, [], None, 1e-9, 0.01),
    ],
)
def test_the_grid_divides_all_times(
    stop: float, times: list[float], fmu_step: float | None, internal_step: float | None, interval: float
) -> None:
    grid = choose_grid(stop, times=times, fmu_step=fmu_step, internal_step=internal_step)
    assert grid.interval == pytest.approx(interval, rel=1e-12)
    for time in (stop, *(t for t in times if t <= stop)):
        assert time / grid.interval == pytest.approx(round(time / grid.interval), abs=1e-9)


def test_the_reason_names_what_did_not_fit() -> None:
    assert choose_grid(10.0, fmu_step=0.1).reason == "the FMU's step"
    assert "step 20 s is longer than the stop time" in choose_grid(10.0, fmu_step=20.0).reason
    assert choose_grid(10.0, times=[0.25], fmu_step=0.1).reason == (
        "the FMU's step 0.1 s does not divide the stop time 10 s and the formula's times 0.25 s; this does"
    )
    assert "a multiple of the FMU's internal step 0.1 s;" in choose_grid(1e3, internal_step=0.1).reason
    unfit = choose_grid(2.0, times=[1.1], internal_step=0.25).reason
    assert "step 0.25 s does not divide" in unfit and "round these times to multiples of 0.25 s" in unfit


def test_the_grid_is_a_multiple_of_a_stated_communication_step() -> None:
    assert choose_grid(10.0, step_size=0.1).interval == 0.1, "not a thousandth of the stop time"
    grid = choose_grid(10.0, fmu_step=0.01, step_size=0.1)
    assert grid.interval == 0.1
    assert grid.reason == "a multiple of step_size = 0.1 s; this divides the stop time 10 s"
    with pytest.raises(SpecError, match=r"step_size: 0\.1 s does not divide the stop time 1\.05 s; change"):
        choose_grid(1.05, fmu_step=0.1, step_size=0.1)


def test_times_that_fit_no_reasonable_grid_are_an_error() -> None:
    with pytest.raises(SpecError, match=r"^no grid of at most 100000 intervals .* round these times"):
        choose_grid(10.0, times=[3.14159265, 2.71828183])
    with pytest.raises(SpecError, match=r"stop time 86399\.95 s and the formula's times 1\.0000001 s"):
        choose_grid(86399.95, times=[1.0000001])


@pytest.mark.parametrize(("fmu_step", "step_size"), [(3e-7, None), (3e-7, 0.1), (None, 7e-9)])
def test_a_step_that_is_far_too_short_for_the_stop_time_is_an_error(
    fmu_step: float | None, step_size: float | None
) -> None:
    with pytest.raises(
        SpecError, match=r"^(the FMU's step|.*step_size =) \S+ s gives more than 10,000,000 steps"
    ):
        choose_grid(10.0, fmu_step=fmu_step, step_size=step_size)


def test_times_of_formulas_are_the_bounds_of_their_windows() -> None:
    texts = ("G[0,1] (F[0.5,2] (x > 0))", "not a formula (")
    formulas = section_formulas([RequirementSection(formula=text) for text in texts], 10.0)
    assert formula_times(formulas) == [0.0, 1.0, 0.5, 2.0]


def test_a_stated_interval_that_does_not_fit_names_one_that_does() -> None:
    assert fitting_interval(parse("G[0,1.75] (x <= 1)"), 10.0, fmu_step=1.0, internal_step=0.25) == 0.25
    with pytest.raises(SpecError, match=r"output_interval=0\.25 fits all times"):
        Problem.from_fmu(
            fmu_path("Lag_2"), "G[0,0.75] (y <= 10)", inputs={"u": (-1.0, 1.0)}, output_interval=0.5
        )


@pytest.mark.parametrize(("stop_time", "period"), [(10.0, 1e-7), (1e18, 0.01), (1e308, 1e-300)])
def test_more_steps_are_refused_with_the_smallest_period(stop_time: float, period: float) -> None:
    with pytest.raises(SpecError, match=r"k: .* more than 10,000,000 steps .* smallest value") as error:
        check_steps(stop_time, period, key="k")
    check_steps(stop_time, float(str(error.value).rpartition(" ")[2]) * 1.000001, key="k")


def test_the_shortest_step_is_refused_in_words_and_half_of_it_confirms() -> None:
    def problem(interval: float) -> Problem:
        return Problem.from_fmu(
            *(fmu_path("Lag_2"), "G[0,1e-8] (u <= 0)"),
            inputs={"u": (0.5, 1.0)},
            stop_time=1e-8,
            output_interval=interval,
        )

    with pytest.raises(SpecError, match=r"output_interval: .* 5e-11 s is so short .* value is 1e-10"):
        problem(5e-11)
    with pytest.raises(SpecError, match=r"FMU's step 1e-12 s is so .* unit; state an output interval: "):
        choose_grid(1e-8, fmu_step=1e-12)
    finest = problem(1e-10)
    found = evaluate(finest, finest.space.decode([1.0] * 5))
    assert confirm(finest, found).outcome == "confirmed"


@pytest.mark.parametrize(
    ("formula", "stop_time", "step", "count", "shortest"),
    [
        ("G[0,50] (y <= 1)", 50.0, 0.01, 200, 0.25),  # no small window: a share of the stop time
        ("G (u >= 1 -> F[0,1] (y <= 1))", 50.0, 0.01, 500, 0.1),  # ten pieces per window
        ("G (F[0,0.02] (y <= 1))", 50.0, 0.01, 1000, 0.05),  # never more than a thousand
        ("G (F[0,0.2] (y <= 1))", 1.0, 0.1, 10, 0.1),  # never shorter than the step
        ("G[2,2] (y <= 1)", 10.0, 0.01, 200, 0.05),  # a moment is no window
        ("y <= 1", 10.0, 20.0, 1, 20.0),
    ],
)
def test_the_limits_follow_from_windows_step_and_stop_time(
    formula: str, stop_time: float, step: float, count: int, shortest: float
) -> None:
    free = default_freedom([parse(formula)], stop_time=stop_time, step=step)
    assert (free.max_control_points, free.min_interval) == (count, shortest)


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


def test_an_input_of_a_spec_without_control_points_is_free_too(tmp_path: Path) -> None:
    assert all(r.free is None for r in echo(tmp_path, "in_Boolean = {control_points = 2}").space.inputs)
    (searched,) = echo(tmp_path, "in_Boolean = {}").space.inputs
    assert searched.free is not None and searched.control_points == 5


def test_control_points_that_were_stated_are_fixed() -> None:
    for choice in ((-1, 1, 5), (-1, 1, 5, "linear")):
        (u,) = lag(u=choice).space.inputs
        assert u.free is None
