"""Search led by what trajectories did that no earlier one did, for robustness without a slope."""

from falsifier.engines.coverage.explorer import Coverage, Explorer

__all__ = ["Coverage", "Explorer"]
