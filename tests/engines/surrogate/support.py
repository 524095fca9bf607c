"""Histories of random simulations."""

import numpy as np

from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout
from falsifier.engines.surrogate import Settings
from falsifier.engines.surrogate.history import History
from falsifier.engines.surrogate.variation import random_points
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem

SETTINGS = Settings()


def history_of(problem: Problem, *, simulations: int, seed: int = 0) -> History:
    interval = problem.experiment.output_interval
    horizon = problem.requirement.formula.horizon(interval)
    grid = Grid.over(horizon, problem.space.stop_time, cells=50, shortest=interval)
    history = History(problem, grid, planning_layout(problem.space, grid), SETTINGS)
    rng = np.random.default_rng(seed)
    for point in random_points(history.layout, rng, simulations):
        history.add(evaluate(problem, history.layout.candidate(point, origin="t", rationale="t")), "t")
    return history
