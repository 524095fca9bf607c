import numpy as np

from falsifier.engines import make_engine
from falsifier.engines.corner_walk import CornerWalk
from falsifier.testing import drive, lag_problem, simulated


def test_corners_come_first_and_each_once() -> None:
    problem = lag_problem(inputs=2, parameters=1)
    engine = make_engine("corners", problem, seed=1)
    asked = drive(engine, simulated(problem, lambda y: float(3 - y.max())), rounds=9)
    corners = {(*(s.values for s in c.signals.values()), *c.parameters.values()) for c in asked[:8]}
    assert len(corners) == 8
    assert all(abs(v) == 2.0 for c in asked[:8] for s in c.signals.values() for v in s.values)
    assert any(abs(v) != 2.0 for s in asked[8].signals.values() for v in s.values)


def test_additive_effects_are_found_within_one_simulation_per_input() -> None:
    weights = np.array([3.0, 0.0, -1.0, 2.0])
    best = float(np.minimum(weights, 0).sum())
    for seed in range(20):
        rng = np.random.default_rng(seed)
        walk = CornerWalk(4)
        costs = []
        for _ in range(5):
            levels = walk.next(rng)
            assert levels is not None
            costs.append(float(weights @ np.array(levels)))
            walk.learn(levels, costs[-1])
        assert min(costs) == best


def test_walk_ends_after_all_corners_and_knows_when_it_is_settled() -> None:
    rng = np.random.default_rng(0)
    walk = CornerWalk(2)
    seen = set()
    while (levels := walk.next(rng)) is not None:
        seen.add(levels)
        walk.learn(levels, float(sum(levels)))
    assert len(seen) == 4
    assert walk.settled
