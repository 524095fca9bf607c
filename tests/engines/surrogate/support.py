"""Histories of random simulations."""

import numpy as np

from falsifier.engines.layout import TimeGrid, planning_layout
from falsifier.engines.surrogate.history import History
from falsifier.engines.surrogate.variation import random_points
from falsifier.evaluation.evaluate import evaluate
from falsifier.problem.problem import Problem


def history_of(problem: Problem, *, simulations: int, seed: int = 0) -> History:
    grid = TimeGrid.of(problem, cells=50)
    history = History(problem, grid, planning_layout(problem.space, grid))
    rng = np.random.default_rng(seed)
    for point in random_points(history.layout, rng, simulations):
        history.add(evaluate(problem, history.layout.candidate(point, origin="t", rationale="t")), point)
    return history
