from dataclasses import replace

import pytest

from falsifier.core.space import Freedom
from falsifier.errors import SpecError
from falsifier.problem.loading import load_problem, load_source
from falsifier.problem.problem import Problem
from falsifier.problem.refinement import coarse_inputs, level_spaces, limits_of, widened, without_limits
from falsifier.problem.source import ProblemSource
from falsifier.testing import FREE, lag_problem
from tests.fmu.fixtures import path as fmu_path


def fmu_problem(formula: str = "G[0,10] (y <= 1)") -> Problem:
    return Problem.from_fmu(fmu_path("Lag_2"), formula, inputs={"u": (-1, 1, 3)}, stop_time=10.0)


def test_coarse_inputs_become_free_within_the_default_limits_and_keep_their_points() -> None:
    (problem,) = widened([lag_problem(points=3)])
    (u,) = problem.space.inputs
    limits = limits_of([problem])
    assert u.free == Freedom(limits.max_control_points, limits.min_interval)
    assert u.control_points == 3
    assert not coarse_inputs(problem.space, limits)


def test_what_is_free_or_fine_already_stays_as_it_is() -> None:
    for problem in (lag_problem(free=FREE), lag_problem(points=200), lag_problem(inputs=0)):
        assert widened([problem]) == [problem]


def test_a_widened_problem_is_loaded_again_from_its_source() -> None:
    for problem in (fmu_problem(), load_problem("python:tests.problems:easy")):
        (wide,) = widened([problem])
        assert wide.source is not None
        assert wide.fingerprint != problem.fingerprint
        assert load_source(wide.source).fingerprint == wide.fingerprint
        assert problem.source is not None
        assert without_limits(wide.source.changes).inputs.keys() == problem.source.changes.inputs.keys()


def test_problems_of_one_search_get_the_same_limits() -> None:
    short, long = fmu_problem("G[0,9] (F[0,0.1] (y <= 1))"), fmu_problem()
    one, other = widened([short, replace(long, requirement=replace(long.requirement, name="LONG"))])
    assert one.space == other.space
    (alone,) = widened([long])
    assert alone.space != one.space


def test_options_other_than_limits_are_still_refused_for_problems_made_in_python() -> None:
    (wide,) = widened([load_problem("python:tests.problems:easy")])
    assert wide.source is not None
    changed = wide.source.model_copy(
        update={"changes": wide.source.changes.model_copy(update={"stop_time": 5.0})}
    )
    with pytest.raises(SpecError, match="options cannot change"):
        load_source(changed)
    with pytest.raises(SpecError, match="options cannot change"):
        load_source(ProblemSource(target="python:tests.problems:easy", stl="G x <= 1"))


def test_levels_for_an_engine_that_chooses_control_points_contain_each_other() -> None:
    (problem,) = widened([lag_problem(points=3)])
    own, finer, whole = level_spaces(problem.space, free=True)
    assert own == problem.space.fixed
    assert finer.inputs[0].free == Freedom(5, 2.5)
    assert whole == problem.space


def test_levels_for_an_engine_on_fixed_points_double_the_pieces_within_the_limits() -> None:
    (problem,) = widened([lag_problem(points=3)])
    shapes = [
        (s.inputs[0].control_points, s.inputs[0].interpolation)
        for s in level_spaces(problem.space, free=False)
    ]
    assert shapes == [(3, "linear"), (4, "constant"), (8, "constant")]
    tight = lag_problem(points=3, free=Freedom(5, 2.0))
    shapes = [
        (s.inputs[0].control_points, s.inputs[0].interpolation) for s in level_spaces(tight.space, free=False)
    ]
    assert shapes == [(3, "linear"), (4, "constant"), (5, "constant")]


def test_levels_that_would_be_the_same_are_one() -> None:
    assert len(level_spaces(lag_problem(inputs=0).space, free=True)) == 1
    assert len(level_spaces(lag_problem(points=200).space, free=False)) == 1
    assert len(level_spaces(lag_problem(points=4, free=FREE).space, free=True)) in (2, 3)
