import pytest

from falsifier.engines import ENGINES, make_engine
from falsifier.engines.box import BoxEngine
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify
from falsifier.search.events import Event, RunStarted
from falsifier.search.refine_levels import (
    engine_parameterization,
    parameterization_note,
    parameterization_of,
    searched_space,
)
from falsifier.search.request import LLMSettings
from falsifier.testing import FREE, lag_problem
from tests.fmu.fixtures import path as fmu_path

# Larger than what the lag can follow: only an input that falls or rises faster than the lag reaches it.
FAST = "G[0,10] (u - x <= 1.5)"


@pytest.mark.parametrize("name", sorted(set(ENGINES) - {"hybrid", "optuna", "botorch"}))
def test_engines_on_the_box_are_known_to_be_fixed(name: str) -> None:
    engine = make_engine(name, lag_problem(), seed=0)
    assert (engine_parameterization(name, None) == "fixed") == isinstance(engine, BoxEngine)


def test_a_language_model_chooses_control_points_if_its_prompt_offers_that() -> None:
    assert engine_parameterization(None, LLMSettings(name="a/b")) == "free"
    assert engine_parameterization(None, LLMSettings(name="a/b", variant="MP2")) == "fixed"
    with_fallback = LLMSettings(name="a/b", variant="MP2", fallback="surrogate")
    assert engine_parameterization(None, with_fallback) == "free"
    assert engine_parameterization("hybrid", LLMSettings(name="a/b", variant="MP2")) == "free"
    assert engine_parameterization("of my own", None) == "free"


def test_a_search_is_not_called_free_if_its_engine_is_not() -> None:
    space = lag_problem(free=FREE).space
    assert parameterization_of(searched_space(space, "surrogate", None)) == "free"
    assert parameterization_of(searched_space(space, "cma", None)) == "fixed"
    assert parameterization_note(searched_space(space, "cma", None)) == (
        "fixed parameterization: u (4 control points, linear)"
    )


def test_an_input_that_only_a_free_parameterization_has_is_found_without_further_options() -> None:
    started: list[Event] = []
    problem = Problem.from_fmu(fmu_path("Lag_2"), FAST, inputs={"u": (-1, 1)}, stop_time=10.0)
    result = falsify(problem, budget=20, listeners=[started.append])
    assert result.falsified
    assert isinstance(started[0], RunStarted)
    assert parameterization_of(started[0].searched) == "free"
    five = Problem.from_fmu(fmu_path("Lag_2"), FAST, inputs={"u": (-1, 1, 5)}, stop_time=10.0)
    assert not falsify(five, "sobol", budget=20).falsified
