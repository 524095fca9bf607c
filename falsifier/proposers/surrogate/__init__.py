"""The default engine: learns the dynamics from trajectories and searches on the model."""

from falsifier.proposers.surrogate.engine import Surrogate
from falsifier.proposers.surrogate.settings import Settings

__all__ = ["Settings", "Surrogate"]
