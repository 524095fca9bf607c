"""The default engine: learns the dynamics from trajectories and searches on their predictions."""

from falsifier.engines.surrogate.settings import Settings as Settings
from falsifier.engines.surrogate.surrogate import Surrogate as Surrogate
