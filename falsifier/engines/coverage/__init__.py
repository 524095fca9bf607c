"""Search led by what trajectories did that no earlier one did, for robustness without a slope."""

from falsifier.engines.coverage.coverage import Coverage
from falsifier.engines.coverage.explorer import Explorer

__all__ = ["Coverage", "Explorer"]
