"""Uniform random search: the yardstick of every other engine."""

import numpy as np

from falsifier.engines.box import BoxProposer, Proposal


class Uniform(BoxProposer):
    """Points drawn uniformly from the box."""

    name = "uniform"

    def _propose(self, rng: np.random.Generator) -> Proposal:
        return Proposal(rng.random(self.box.dimension), "uniform random")
