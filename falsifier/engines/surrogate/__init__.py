"""The default engine: learns the dynamics from trajectories and searches on their predictions."""

from falsifier.engines.surrogate.settings import Settings
from falsifier.engines.surrogate.surrogate import Surrogate

__all__ = ["Settings", "Surrogate"]
