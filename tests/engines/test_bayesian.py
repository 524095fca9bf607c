import numpy as np
import pytest

from falsifier.engines import make_engine
from falsifier.engines.bayesian import log_improvement
from falsifier.testing import lag_problem, simulated
from tests.engines.support import best_of, bowl, need


@pytest.mark.parametrize(
    ("engine", "simulations"), [("cma", 150), ("bayesian", 40), ("optuna", 80), ("botorch", 30)]
)
def test_learning_engines_go_down_a_bowl(engine: str, simulations: int) -> None:
    need(engine)
    assert best_of(engine, simulations=simulations) < 1.3 < best_of("uniform", simulations=simulations)


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


def test_log_improvement_is_the_logarithm_and_finite_where_that_underflows() -> None:
    z = np.array([-8.0, -4.0, -2.9, 0.0, 3.0])
    from scipy.stats import norm

    exact = np.log(norm.pdf(z[1:]) + z[1:] * norm.cdf(z[1:]))
    values = log_improvement(-z, np.ones(5), 0.0)
    assert values[1:] == pytest.approx(exact, abs=1e-6)
    far = log_improvement(np.array([20.0, 40.0, 400.0]), np.ones(3), 0.0)
    assert np.isfinite(far).all() and (np.diff(far) < 0).all()
