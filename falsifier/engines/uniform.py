"""Uniform random search: the baseline for all other engines."""

import numpy as np

from falsifier.engines.box import BoxEngine, Proposal


class Uniform(BoxEngine):
    """Points drawn uniformly at random from the box."""

    name = "uniform"

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "uniform random")
