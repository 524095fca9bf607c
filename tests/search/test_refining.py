"""A bug that only fast inputs reach: slow ones are searched first and do not find it."""

from math import nan
from pathlib import Path

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.counterexamples.case import nearest_miss
from falsifier.engines import make_engine
from falsifier.errors import SpecError
from falsifier.problem.loading import load_problem
from falsifier.record import manifest
from falsifier.record.run import falsify, resume
from falsifier.search.budget import Budget
from falsifier.search.refine_levels import level_results, level_starts
from falsifier.search.result import Result
from falsifier.testing import BIAS, FREE, START, lag_problem
from tests.problems import fast_only
from tests.searches import stop_after

BUDGET = 30


def candidates(result: Result) -> list[object]:
    return [e.candidate.key for e in result.evaluations]


def test_a_finer_level_finds_what_the_coarse_one_cannot() -> None:
    assert not falsify(fast_only(), "cma", budget=BUDGET).falsified
    result = falsify(fast_only(), "cma", budget=BUDGET, refine=True)
    assert result.falsified
    assert result.spent.simulations <= BUDGET
    levels = [(level.first, level.searched) for level in result.levels]
    found = level_results(levels, [e.robustness for e in result.evaluations], falsified=True)
    assert [level.falsified for level in found] == [False, True, False]
    coarse = result.evaluations[: result.levels[1].first]
    assert all(not e.violated and e.candidate.signals["u"].interpolation == "linear" for e in coarse)
    assert len(set(candidates(result))) == len(candidates(result))


def test_levels_share_the_budget_equally_and_the_last_one_gets_the_rest() -> None:
    space = lag_problem(points=3, free=FREE).space
    assert level_starts(space, "cma", None, Budget(100)) == (0, 34, 67)
    assert level_starts(space, "cma", None, Budget(2)) == (0, 1)
    assert level_starts(space, "cma", None, Budget(1)) == (0,)
    assert level_starts(space, "cma", None, Budget(None, seconds=60)) == (0, 34, 67)


@pytest.mark.parametrize("stopped", [4, 13])
def test_a_resumed_run_goes_on_at_the_level_on_which_it_stopped(stopped: int, tmp_path: Path) -> None:
    whole = falsify(fast_only(), "cma", budget=BUDGET, refine=True)
    name, stop = "python:tests.problems:fast_only", stop_after(stopped)
    first = falsify(name, "cma", budget=BUDGET, refine=True, directory=tmp_path, listeners=stop)
    assert (first.status, len(first.evaluations)) == ("interrupted", stopped)
    (again,) = resume(tmp_path)
    assert again.falsified
    assert candidates(again) == candidates(whole)
    assert again.levels == whole.levels


def test_a_larger_budget_for_the_rest_does_not_move_the_levels(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 2)", points=3)
    result = falsify(problem, "uniform", budget=6, refine=True, directory=tmp_path)
    (again,) = resume(tmp_path, problems=[problem], budget=9)
    assert again.levels == result.levels
    assert len(again.evaluations) == 9


def test_the_record_says_what_the_levels_were(tmp_path: Path) -> None:
    target = "python:tests.problems:impossible"
    result = falsify(target, "uniform", budget=9, refine=True, directory=tmp_path)
    described = manifest.read(tmp_path)
    assert described.parameterization == "refined"
    assert [(level.first, level.searched) for level in described.levels] == [
        (0, "fixed parameterization: u (4 control points, linear)"),
        (3, "fixed parameterization: u (6 control points, constant)"),
        (6, "fixed parameterization: u (12 control points, constant)"),
    ]
    miss = nearest_miss(tmp_path)
    assert result.best is not None
    assert miss.simulated(miss.problem()[0]).robustness == pytest.approx(result.best.robustness)


def test_requirements_that_share_a_search_share_its_levels() -> None:
    other = lag_problem("G[0,10] (x <= 2)", points=3, name="NEVER")
    fast, never = falsify([fast_only(), other], "cma", budget=BUDGET, refine=True)
    assert fast.falsified
    assert not never.falsified
    assert len(never.evaluations) == BUDGET
    assert fast.levels == never.levels


def test_what_the_last_level_left_out_is_told() -> None:
    result = falsify(lag_problem("G[0,10] (x <= 2)", points=3), "uniform", budget=6, refine=True)
    (told,) = [f.text for f in result.findings if f.kind == "parameterization"]
    assert "u had 8 held pieces of 1.25 s" in told
    assert "--engine surrogate" in told


def test_a_search_that_ended_on_a_coarse_level_says_so() -> None:
    problem = lag_problem("G[0,10] (x <= 2)", points=3)
    result = falsify(problem, "uniform", budget=30, refine=True, listeners=stop_after(4))
    (told,) = [f.text for f in result.findings if f.kind == "parameterization"]
    assert "more simulations; the search ended on level 1 of 3" in told


def test_known_inputs_come_first_and_count_for_the_first_level() -> None:
    known = Candidate({"u": Signal((0.0, 4.0), (0.0, 0.1), "constant")})
    result = falsify(fast_only(), "cma", budget=BUDGET, refine=True, start_from=[known])
    assert result.evaluations[0].candidate.signals["u"].times == (0.0, 4.0)
    assert result.falsified


def test_a_budget_for_one_level_is_spent_on_the_coarse_one() -> None:
    result = falsify(fast_only(), "surrogate", budget=1, refine=True)
    (only,) = result.evaluations
    assert only.candidate.signals["u"].interpolation == "linear"
    assert result.searched == fast_only().space
    (told,) = [f.text for f in result.findings if f.kind == "parameterization"]
    assert told.endswith("To try them: a larger budget, which allows another level.")


def test_nothing_to_refine_is_one_level() -> None:
    result = falsify(lag_problem(inputs=0, parameters=[START, BIAS]), "uniform", budget=4, refine=True)
    assert not result.levels
    assert len(result.evaluations) == 4


def test_levels_need_engines_that_can_be_made_by_name() -> None:
    problem = fast_only()
    with pytest.raises(SpecError, match="pass the name of an engine"):
        falsify(problem, make_engine("cma", problem, seed=0), refine=True)
    with pytest.raises(SpecError, match="drop --parameterization fixed"):
        falsify(load_problem("AT1", parameterization="fixed"), "uniform", budget=3, refine=True)


SPACE = lag_problem().space
LEVELS = ((0, "slow"), (4, "faster"), (8, "fast"))


def test_what_came_of_each_level_is_told() -> None:
    found = level_results(LEVELS, [3.0, 1.0, None, 2.0, nan, None], falsified=False)
    assert [f"{level.name}: {level.text}" for level in found] == [
        "level 1 of 3: 4 simulations, smallest robustness +1: slow",
        "level 2 of 3: 2 simulations, all failed: faster",
        "level 3 of 3: not begun: fast",
    ]
