"""The coverage engine: leads the search by what trajectories did that no earlier one did."""

from collections.abc import Sequence

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines.coverage.explorer import Explorer
from falsifier.engines.grid import Grid
from falsifier.engines.layout import planning_layout
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# Cells over the formula's horizon on which free inputs are held.
_CELLS = 100


class Coverage:
    """Collects inputs that reached something new, and goes on from these; robustness is not used."""

    name = "coverage"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        space, interval = problem.space, problem.experiment.output_interval
        horizon = problem.requirement.formula.horizon(interval)
        grid = Grid.over(horizon, space.stop_time, cells=_CELLS, shortest=interval)
        self.layout = planning_layout(space, grid)
        self.seed = seed
        self._explorer = Explorer(problem, self.layout)
        self._asked = 0

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates."""
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add the trajectories to what was reached."""
        for evaluation in evaluations:
            if evaluation.trajectory is not None:
                self._explorer.learn(self.layout.point(evaluation.candidate), evaluation.trajectory)

    def _ask_one(self) -> Candidate:
        idea = self._explorer.propose(np.random.default_rng([self.seed, self._asked]))
        self._asked += 1
        return self.layout.candidate(idea.point, origin=self.name, rationale=idea.why)
