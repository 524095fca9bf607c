"""Search led by what trajectories did that no earlier one did, for robustness without a slope."""

from falsifier.engines.coverage.explorer import CoverageEngine as CoverageEngine, Explorer as Explorer
from falsifier.engines.coverage.ladder import Ladder as Ladder
