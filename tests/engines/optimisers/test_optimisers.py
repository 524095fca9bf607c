"""The general optimisers on the fixed control points: what they share, and what only one of them does."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from falsifier.engines import make_engine
from falsifier.engines.optimisers.gaussian_process import fit_lengths
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.testing import drive, lag_problem
from tests.engines.support import best_of, bowl, box_problem, flat


@pytest.mark.parametrize(("name", "simulations"), [("cma", 150), ("bayesian", 40), ("optuna", 80)])
def test_it_gets_deeper_into_a_bowl_than_random_points(name: str, simulations: int) -> None:
    assert best_of(name, simulations=simulations) < 1.3 < best_of("uniform", simulations=simulations)


def test_in_a_known_valley_optuna_does_not_ask_for_the_same_place_several_times_at_once() -> None:
    problem = box_problem()
    engine = make_engine("optuna", problem, seed=2)
    for _ in range(20):
        engine.tell([bowl(problem, *engine.ask())])
    batch = np.array([problem.space.encode(c) for c in engine.ask(4)])
    assert np.linalg.norm(batch[:, None] - batch, axis=2)[np.triu_indices(4, 1)].min() > 5e-3


def test_a_generation_is_complete_before_the_next_one_and_the_wait_is_bridged() -> None:
    problem = box_problem()
    engine, other = (make_engine("cma", problem, seed=s) for s in (0, 1))
    asked = engine.ask(20)
    own = [c for c in asked if c.rationale.startswith("generation 1 ")]
    waiting = {c.rationale for c in asked[len(own) :]}
    assert waiting == {"uniform random, while a generation is simulated"}
    engine.tell([bowl(problem, c) for c in own[:-1]])
    assert not engine.ask()[0].rationale.startswith("generation")
    engine.tell([Evaluation(own[-1], "failed", reason="diverged")])
    engine.tell([bowl(problem, c) for c in other.ask(2)])
    assert engine.ask()[0].rationale.startswith("generation 2 ")


def test_the_evolution_strategy_restarts_on_a_plateau() -> None:
    engine = make_engine("cma", box_problem(), seed=0)
    generations = {int(c.rationale.split()[1]) for c in drive(engine, flat, rounds=100)}
    assert generations == {1}, "a plateau ends a start after its first generation"


@pytest.mark.parametrize("name", ["cma", "optuna"])
def test_candidates_of_whole_numbers_are_recognised(name: str) -> None:
    problem = box_problem()
    space = replace(problem.space, inputs=tuple(replace(r, kind="integer") for r in problem.space.inputs))
    problem = replace(problem, space=space)
    asked = drive(make_engine(name, problem, seed=0), partial(bowl, problem), rounds=60)
    assert sum("uniform random" in c.rationale for c in asked) < 20


def test_a_single_coordinate_can_be_searched() -> None:
    problem = lag_problem(points=1)
    engine = make_engine("cma", problem, seed=0)
    values = [c.signals["u"].values[0] for c in drive(engine, lambda c: evaluate(problem, c), rounds=40)]
    assert max(values) == pytest.approx(1.0, abs=0.1), "x is highest where u is"


def test_optuna_learns_from_candidates_of_others_and_announces_nothing(
    capfd: pytest.CaptureFixture[str],
) -> None:
    problem = box_problem()
    alone, taught = (make_engine("optuna", problem, seed=1) for _ in range(2))
    for candidate in make_engine("uniform", problem, seed=5).ask(60):
        taught.tell([bowl(problem, candidate)])
    found = [min(bowl(problem, c).robustness or 9.0 for c in engine.ask(5)) for engine in (taught, alone)]
    assert found[0] < found[1]
    taught.tell([Evaluation(c, "failed") for c in taught.ask(2)])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("seed", range(3))
def test_points_that_nearly_coincide_leave_a_covariance_that_can_be_factored(seed: int) -> None:
    rng = np.random.default_rng(seed)
    apart = 10.0 ** -rng.uniform(3, 12) * rng.standard_normal((80, 8))
    points = rng.random((5, 8))[rng.integers(0, 5, 80)] + apart
    assert np.isfinite(fit_lengths(points, rng.standard_normal(80), noise=1e-4).weights).all()


def test_two_of_thirty_coordinates_that_matter_are_told_from_few_points() -> None:
    points = np.random.default_rng(0).random((30, 30))
    values = np.sin(4 * points[:, 3]) + (points[:, 17] - 0.4) ** 2
    targets = (values - values.mean()) / values.std()
    lengths = fit_lengths(points, targets, noise=1e-4).lengths
    assert set(np.argsort(lengths)[:2]) == {3, 17}
