from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.core.ranges import InputRange
from falsifier.engines import ENGINES, make_engine
from falsifier.engines.box import BoxEngine
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.record.run import falsify
from falsifier.search.events import Event, RunStarted
from falsifier.search.findings import failures, inexpressible
from falsifier.search.parameterization import (
    engine_parameterization,
    parameterization_note,
    parameterization_of,
    searched_space,
)
from falsifier.search.request import LLMSettings
from falsifier.testing import FREE, lag_problem
from tests.fmu.fixtures import path as fmu_path


def test_failures_that_differ_only_in_numbers_have_one_cause() -> None:
    reasons = [
        (2, "m: index 0 is outside of 1..5 at t = 1.25s"),
        (4, "m: car2 diverged at 0x7f01"),
        (5, "m: index -3 is outside of 1..5 at t = 2e-3s"),
        (6, "m: car3 diverged at 0x7f02"),
    ]
    found = failures(reasons)
    assert [(f.count, f.simulation) for f in found] == [(2, 3), (1, 5), (1, 7)]
    assert found[0].text.startswith("2 simulations failed, for example simulation 3: m: index 0 is out")
    assert found[1].text == "simulation 5 failed: m: car2 diverged at 0x7f01"


def told(problem: Problem, engine: str = "surrogate") -> str:
    finding = inexpressible(problem, engine_parameterization(engine, None))
    return finding.text if finding else ""


def test_what_a_fixed_space_cannot_express_is_told_with_the_option_that_widens_it() -> None:
    formula = "G[0,9] (F[0,1] (y <= 1))"
    stated = Problem.from_fmu(fmu_path("Lag_2"), formula, inputs={"u": (-1, 1, 5)}, stop_time=10.0)
    assert told(stated) == (
        "Faster inputs were not tried: u had 5 control points (pchip) and needed 2.5 s from -1 to 1. The "
        "formula's smallest window is 1 s. To try them: shortest_piece=0.05."
    )
    assert stated.source is not None
    asked = stated.source.model_copy(update={"parameterization": "fixed"})
    assert told(replace(stated, source=asked)).endswith("To try them: shortest_piece=0.05.")
    assert told(stated, "cma").endswith("To try them: engine='surrogate' with shortest_piece=0.05.")
    assert told(replace(stated, source=None)).endswith(" InputRange(..., free=Freedom(200, 0.05)).")


def test_the_remedy_depends_on_why_the_space_was_fixed() -> None:
    free = lag_problem(free=FREE)
    assert not told(free)
    assert not told(lag_problem(points=100)), "as many control points as make sense leave nothing out"
    assert "engine='surrogate'" in told(free, "cma")
    fixed = load_problem("AT1", parameterization="fixed")
    assert told(fixed).endswith("To try them: shortest_piece=0.25.")
    assert told(fixed, "cma").endswith("To try them: engine='surrogate' with shortest_piece=0.25.")


def test_a_section_in_the_remedy_is_one_that_toml_reads(tmp_path: Path) -> None:
    given = (
        f'[model]\nfmu = "{fmu_path("Arrays_3")}"\nstop_time = 9\n[requirements]\nR.formula = "y[1] > 0"\n'
    )
    (tmp_path / "a.toml").write_text(f'{given}[inputs."u[1]"]\nrange = [0, 1]\ncontrol_points = 2\n')
    problem = load_problem(tmp_path / "a.toml", interface="co-simulation")
    assert told(problem).endswith('} in [inputs."u[1]"].')


def test_constant_and_held_inputs_are_described_as_such() -> None:
    problem = lag_problem()
    u = problem.space.inputs[0]

    def text(changed: InputRange) -> str:
        return told(replace(problem, space=replace(problem.space, inputs=(changed,))))

    assert "u was constant" in text(replace(u, control_points=1))
    assert "u had 4 held pieces of 2.5 s" in text(replace(u, interpolation="constant"))


# Larger than what the lag can follow: only an input that falls or rises faster than the lag reaches it.
FAST = "G[0,10] (u - x <= 1.5)"


@pytest.mark.parametrize("name", sorted(set(ENGINES) - {"hybrid", "optuna"}))
def test_engines_on_the_box_are_known_to_be_fixed(name: str) -> None:
    engine = make_engine(name, lag_problem(), seed=0)
    assert (engine_parameterization(name, None) == "fixed") == isinstance(engine, BoxEngine)


def test_a_search_is_called_free_if_its_engine_or_prompt_offers_control_points() -> None:
    assert engine_parameterization(None, LLMSettings(name="a/b")) == "free"
    assert engine_parameterization(None, LLMSettings(name="a/b", variant="MP2")) == "fixed"
    assert engine_parameterization("hybrid", LLMSettings(name="a/b", variant="MP2")) == "free"
    assert engine_parameterization("of my own", None) == "free"
    space = lag_problem(free=FREE).space
    assert parameterization_of(searched_space(space, "free")) == "free"
    assert parameterization_of(searched_space(space, "fixed")) == "fixed"
    assert parameterization_note(searched_space(space, "fixed")) == (
        "fixed parameterization: u (4 control points, linear)"
    )


def test_an_input_that_only_a_free_parameterization_has_is_found_without_further_options() -> None:
    started: list[Event] = []
    problem = Problem.from_fmu(fmu_path("Lag_2"), FAST, inputs={"u": (-1, 1)}, stop_time=10.0)
    assert falsify(problem, budget=20, listeners=[started.append]).falsified
    assert isinstance(started[0], RunStarted)
    assert parameterization_of(started[0].searched) == "free"
    five = Problem.from_fmu(fmu_path("Lag_2"), FAST, inputs={"u": (-1, 1, 5)}, stop_time=10.0)
    assert not falsify(five, "uniform", budget=20).falsified
