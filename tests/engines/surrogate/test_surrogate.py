from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from bench.example_systems import function_problem
from falsifier.context.values import Context, Crossing
from falsifier.core.model import Kind
from falsifier.core.ranges import Freedom, InputRange, ParameterRange
from falsifier.engines import make_engine
from falsifier.engines.surrogate import Surrogate
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import Requirement
from falsifier.stl import parse
from falsifier.testing import BIAS, FREE, START, Array, drive, lag_problem
from tests.engines.coverage.support import lock_problem
from tests.engines.support import HASTY


def simulations_until_violation(problem: Problem, *, seed: int, budget: int) -> int | None:
    engine = make_engine("surrogate", problem, seed=seed)
    for count in range(1, budget + 1):
        (candidate,) = engine.ask()
        evaluation = evaluate(problem, candidate)
        if evaluation.violated:
            return count
        engine.tell([evaluation])
    return None


def oscillator_problem(formula: str) -> Problem:
    """A weakly damped oscillator of period 2 s, driven by one input in [-1, 1]."""
    u = InputRange("u", -1.0, 1.0, control_points=5, free=Freedom(200, 0.05))
    return function_problem(_oscillator, formula, (u,), (), {"x": "real"}, 20.0, 0.02)


def _oscillator(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
    step, x, v = times[1] - times[0], 0.0, 0.0
    column = np.empty_like(times)
    for k, u in enumerate(inputs["u"]):
        column[k] = x
        v += step * (np.pi**2 * (u - x) - 0.1 * v)
        x += step * v
    return {"x": column}


def test_finds_a_resonance_that_no_constant_excites() -> None:
    # A constant overshoots to 2 at most; only inputs that switch with the period reach 4.
    problem = oscillator_problem("G[0,20] (x <= 4)")
    counts = [simulations_until_violation(problem, seed=seed, budget=20) for seed in range(3)]
    assert all(count is not None for count in counts), counts


def test_goes_on_where_a_predicate_is_undefined_at_times_that_do_not_matter() -> None:
    problem = lag_problem("log(x + 0.1) <= 3", free=FREE)  # judged at time 0 only
    judged = partial(evaluate, problem)
    assert len(drive(Surrogate(problem, seed=0), judged, rounds=12)) == 12


def test_violates_a_condition_on_two_times_at_once() -> None:
    # High by 2 s although below 0.1 at 1 s, and low again at the end: no extreme does that.
    problem = lag_problem("(F[0,1] (x > 0.1)) or (G[2,4] (x < 0.5)) or (F[6,10] (x > -0.5))", free=FREE)
    counts = [simulations_until_violation(problem, seed=seed, budget=40) for seed in range(2)]
    assert all(count is not None for count in counts), counts


def test_parameters_alone_are_tried_at_their_corners_first() -> None:
    problem = lag_problem("(G[0,0] (x < 0.99)) or (G[10,10] (x < 0.99))", inputs=0, parameters=[START, BIAS])
    for seed in range(6):
        count = simulations_until_violation(problem, seed=seed, budget=5)
        assert count is not None and count <= 4


def test_a_constant_of_someone_else_near_an_extreme_stands_for_it() -> None:
    problem = lag_problem("G[0,10] (x <= 9)", inputs=1)
    for level, opposite in ((-0.95, 1.0), (0.9, -1.0)):
        for seed in range(3):
            engine = Surrogate(problem, seed=seed, settings=HASTY)
            engine.tell([evaluate(problem, problem.space.decode([level] * 4))])
            (candidate,) = engine.ask()
            assert candidate.signals["u"].values == (opposite,) * 4


def arms(problem: Problem, *, rounds: int) -> Counter[str]:
    """How often each kind of reason was given, by its first words."""
    asked = drive(Surrogate(problem, seed=0, settings=HASTY), partial(evaluate, problem), rounds=rounds)
    return Counter(c.rationale.split(":")[0][:20] for c in asked)


def test_where_discrete_signals_do_new_things_what_they_did_is_gone_on_from_and_elsewhere_dynamics_lead() -> (
    None
):
    flat, sloped = lock_problem(free=FREE), lag_problem("G[0,10] (x <= 1.25)", free=FREE)
    assert arms(flat, rounds=60)["the input that made "] > 20
    assert arms(sloped, rounds=40)["the learnt dynamics "] > 10


def test_no_simple_way_loses_all_of_its_turns() -> None:
    problem = lag_problem("G[0,10] (x <= 1.25)", free=FREE)
    found = arms(problem, rounds=120)
    assert {c.origin for c in Surrogate(problem, seed=0, settings=HASTY).ask(4)} == {"surrogate"}
    assert min(found["uniform random"], found["generation 1 of the "]) >= 3


def test_where_robustness_is_a_staircase_the_way_to_its_lowest_level_is_gone_on_from() -> None:
    problem = lock_problem(free=FREE)
    stages = replace(problem, requirement=Requirement("STAGES", parse("G[0,10] (stage <= 3)")))
    assert simulations_until_violation(stages, seed=0, budget=100) is not None
    stages = replace(problem, requirement=Requirement("STAGES", parse("G[0,10] (stage <= 6)")))
    asked = drive(Surrogate(stages, seed=0, settings=HASTY), partial(evaluate, stages), rounds=60)
    assert sum("that made the robustness" in c.rationale for c in asked) > 3


def boiler(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
    """Heat that is stored slowly; a limiter acts at a heat that is never reached."""
    heat, level = np.zeros(len(times)), 0.0
    for k, burning in enumerate(inputs["burner"].tolist()):
        level += 0.01 * (burning - level)
        heat[k] = level
    return {"heat": heat, "cuts": np.maximum.accumulate((heat > 0.95).astype(float))}


def test_an_output_is_driven_further_where_the_robustness_is_the_same_for_all() -> None:
    burner = InputRange("burner", 0.0, 0.9, control_points=12, interpolation="linear")
    outputs: dict[str, Kind] = {"cuts": "integer", "heat": "real"}
    problem = function_problem(boiler, "G[0,60] (cuts < 0.5)", (burner,), (), outputs, 60.0, 0.2)
    highest = defaultdict(list)
    for candidate in drive(Surrogate(problem, seed=1, settings=HASTY), partial(evaluate, problem), rounds=40):
        trajectory = evaluate(problem, candidate).trajectory
        assert trajectory is not None
        highest[candidate.rationale].append(float(trajectory["heat"].max()))
    up, down = highest["drives heat further up"], highest["drives heat further down"]
    # Of 2000 uniform inputs none exceeds 0.7. Nothing discrete is new, so each way is tried three times.
    assert max(up) > 0.75 and len(up) == len(down) == 3


def test_parallel_candidates_differ() -> None:
    problem = lag_problem(free=FREE, parameters=[START])
    engine = Surrogate(problem, seed=0, settings=HASTY)
    engine.tell([evaluate(problem, c) for c in engine.ask(3)])
    assert len({c.key for c in engine.ask(6)}) == 6


SWITCH = {"low": 0.0, "high": 1.0, "kind": "boolean"}
STEPS = [replace(p, low=0.0, high=9.0, kind="integer") for p in (START, BIAS)]


@pytest.mark.parametrize(
    ("inputs", "parameters"),
    [
        ([{}, {"low": 0.5, "high": 0.5}], []),
        ([SWITCH | {"free": None}, SWITCH | {"free": None}], []),
        ([{}, SWITCH], []),
        ([], STEPS),
        ([{"free": None, "control_points": 1}], []),
        ([], [ParameterRange("x0", 0, 59, kind="integer")]),
    ],
    ids=[
        "one cannot vary",
        "switches at control points",
        "one switch",
        "whole parameters",
        "one number",
        "sixty whole numbers",
    ],
)
def test_nothing_is_simulated_twice_where_many_points_are_the_same_candidate(
    inputs: Sequence[dict[str, Any]], parameters: Sequence[ParameterRange]
) -> None:
    problem = lag_problem("G[0,10] (x <= 99)", free=FREE, inputs=len(inputs), parameters=parameters)
    ranges = tuple(replace(r, **new) for r, new in zip(problem.space.inputs, inputs, strict=True))
    problem = replace(problem, space=replace(problem.space, inputs=ranges))
    asked = drive(Surrogate(problem, seed=1, settings=HASTY), partial(evaluate, problem), rounds=60)
    assert len({c.key for c in asked}) == 60


@pytest.mark.parametrize(("points", "free"), [(3, None), (4, FREE), (1, None)])
def test_switching_inputs_say_how_often_they_do(points: int, free: Freedom | None) -> None:
    problem = lag_problem("G[0,6] (F[0,2] (x <= 0.9))", points=points, free=free)
    reasons = [candidate.rationale for candidate in Surrogate(problem, seed=0, settings=HASTY).ask(4)]
    told = "inputs take a random bound every {} s, or at control points that are further apart"
    assert {told.format(0.5), told.format(1)} & set(reasons)


def narrow_problem(levels: tuple[Crossing, ...] = ()) -> Problem:
    """A counter of how often an input entered a band of 0.2 % of its range; three times violate."""
    u = InputRange("u", 0.0, 1.0, control_points=5, free=Freedom(50, 0.2))
    problem = function_problem(_entered, "G[0,10] (n < 2.5)", (u,), (), {"n": "integer"}, 10.0, 0.1)
    return replace(problem, context=Context(crossings=levels))


def _entered(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
    inside = np.abs(inputs["u"] - 0.618) < 0.001
    return {"n": np.cumsum(inside & ~np.append(False, inside[:-1])).astype(float)}


def test_levels_of_context_files_are_tried() -> None:
    levels = (Crossing("u", 0.617), Crossing("u", 0.619))
    told, untold = (
        sum(simulations_until_violation(narrow_problem(known), seed=s, budget=200) or 200 for s in range(4))
        for known in (levels, ())
    )
    assert told < 0.5 * untold


def test_without_levels_nothing_changes() -> None:
    plain, misplaced = narrow_problem(), narrow_problem((Crossing("other", 1.0),))
    engine = make_engine("surrogate", plain, seed=1)
    assert [c.key for c in engine.ask(5)] == [
        c.key for c in make_engine("surrogate", misplaced, seed=1).ask(5)
    ]
