"""Quasi-random search: a scrambled Sobol sequence covers the box more evenly than random points do."""

import numpy as np
from scipy.stats import qmc

from falsifier.engines.box import BoxEngine, Proposal
from falsifier.problem.problem import Problem

# Number of coordinates for which scipy has direction numbers; further ones are drawn at random.
_MAX_DIMENSIONS = qmc.Sobol.MAXDIM


class Sobol(BoxEngine):
    """Successive points of one scrambled Sobol sequence."""

    name = "sobol"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        super().__init__(problem, seed=seed)
        self._sequence = qmc.Sobol(
            min(self.box.dimension, _MAX_DIMENSIONS), scramble=True, seed=np.random.default_rng(seed)
        )

    def _propose(self, rng: np.random.Generator) -> Proposal:
        point = rng.random(self.box.dimension)
        point[:_MAX_DIMENSIONS] = self._sequence.random(1)[0]
        return Proposal(point, f"point {self._asked + 1} of a Sobol sequence")
