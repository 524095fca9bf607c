import threading

import numpy as np
import pytest

from falsifier.core.candidate import Candidate
from falsifier.engines import make_engine
from falsifier.engines.bayesian import log_improvement
from falsifier.engines.gaussian_process import GaussianProcess, fit_lengths, standardised
from falsifier.problem.problem import Problem
from falsifier.testing import lag_problem, simulated

TARGET = np.array([1.2, -0.4, 0.3, -1.5, 0.7])


def bowl(problem: Problem, candidate: Candidate) -> float:
    return 1.0 + float(((problem.space.encode(candidate) - TARGET) ** 2).sum())


def best_of(name: str, *, simulations: int) -> float:
    problem = lag_problem()
    engine = make_engine(name, problem, seed=1)
    costs = []
    for _ in range(simulations):
        (candidate,) = engine.ask()
        cost = bowl(problem, candidate)
        costs.append(cost)
        engine.tell([simulated(problem, lambda y, cost=cost: cost)(candidate)])  # type: ignore[misc]
    return min(costs)


@pytest.mark.parametrize(
    ("engine", "simulations"), [("cma", 150), ("bayesian", 40), ("optuna", 80), ("botorch", 30)]
)
def test_learning_engines_go_down_a_bowl(engine: str, simulations: int) -> None:
    need(engine)
    assert best_of(engine, simulations=simulations) < 1.3 < best_of("uniform", simulations=simulations)


def test_annealing_is_scipys_and_ends_its_thread() -> None:
    assert best_of("annealing", simulations=150) < best_of("uniform", simulations=10)
    for thread in threading.enumerate():
        if thread.name == "annealing":
            thread.join(timeout=5)
    assert not [t for t in threading.enumerate() if t.name == "annealing"]


@pytest.mark.parametrize("engine", ["annealing", "cma", "bayesian", "optuna", "botorch"])
def test_parallel_candidates_of_a_generation_differ(engine: str) -> None:
    need(engine)
    keys = {c.key for c in make_engine(engine, lag_problem(), seed=3).ask(12)}
    assert len(keys) == 12


@pytest.mark.parametrize("name", ["optuna", "botorch"])
def test_a_batch_spreads_around_a_known_valley(name: str) -> None:
    need(name)
    problem = lag_problem()
    engine = make_engine(name, problem, seed=2)
    for _ in range(20):
        (candidate,) = engine.ask()
        cost = bowl(problem, candidate)
        engine.tell([simulated(problem, lambda y, cost=cost: cost)(candidate)])  # type: ignore[misc]
    batch = np.array([problem.space.encode(c) for c in engine.ask(4)])
    distances = np.linalg.norm(batch[:, None] - batch, axis=2)[np.triu_indices(4, 1)]
    assert distances.min() > 1e-2


def need(engine: str) -> None:
    if engine == "botorch":
        pytest.importorskip("botorch", reason="it brings torch, several hundred MB")


def test_process_interpolates_and_is_unsure_far_away() -> None:
    points = np.linspace(0, 1, 9)[:, None]
    targets = np.sin(5 * points[:, 0])
    process = fit_lengths(points, targets, np.array([0.3]), np.random.default_rng(0), noise=1e-6)
    mean, deviation = process.predict(np.array([[0.5], [0.44], [3.0]]))
    assert mean[0] == pytest.approx(np.sin(2.5), abs=1e-3)
    assert mean[1] == pytest.approx(np.sin(2.2), abs=0.05)
    assert deviation[0] < 0.01 and deviation[2] > 0.5


def test_evidence_prefers_the_right_length_scale() -> None:
    rng = np.random.default_rng(1)
    points = rng.random((40, 2))
    targets = np.sin(9 * points[:, 0])
    along, across = (
        GaussianProcess.fit(points, targets, np.array(lengths), noise=1e-4).evidence
        for lengths in ([0.4, 5.0], [5.0, 0.4])
    )
    assert along > across


def test_log_improvement_is_the_logarithm_and_finite_where_that_underflows() -> None:
    z = np.array([-8.0, -4.0, -2.9, 0.0, 3.0])
    from scipy.stats import norm

    exact = np.log(norm.pdf(z[1:]) + z[1:] * norm.cdf(z[1:]))
    values = log_improvement(-z, np.ones(5), 0.0)
    assert values[1:] == pytest.approx(exact, abs=1e-6)
    far = log_improvement(np.array([20.0, 40.0, 400.0]), np.ones(3), 0.0)
    assert np.isfinite(far).all() and (np.diff(far) < 0).all()


def test_one_huge_cost_does_not_hide_small_differences() -> None:
    targets = standardised(np.array([1.0, 1.1, 1.2, 1e9]))
    assert np.diff(targets).min() > 0.1
