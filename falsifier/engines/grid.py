"""The time grid on which engines hold free inputs and predict outputs."""

from dataclasses import dataclass

import numpy as np

from falsifier.engines.box import Array

# Maximum length of the grid in horizons of the formula; later times contribute little to the dynamics.
_MAX_HORIZONS = 20


@dataclass(frozen=True, slots=True)
class Grid:
    """Evenly spaced times from 0 over the formula's horizon, and on to the end of the simulation.

    Attributes:
        step: step in s.
        cells: number of cells over the horizon.
        all_cells: number of complete cells until the end of the simulation, at most twenty horizons.
    """

    step: float
    cells: int
    all_cells: int

    @classmethod
    def over(cls, horizon: float, stop_time: float, *, cells: int, shortest: float) -> "Grid":
        """Return a grid of ``cells`` cells over the horizon, fewer if needed for cells of ``shortest`` s."""
        horizon = min(horizon, stop_time) if horizon > 0 else stop_time
        count = max(1, min(cells, round(horizon / shortest)))
        step = horizon / count
        rest = int(stop_time / step + 1e-6)
        return cls(step, count, max(count, min(rest, _MAX_HORIZONS * count)))

    @property
    def middles(self) -> Array:
        """Middle times of the horizon's cells in s, shape (cells,)."""
        return np.asarray((np.arange(self.cells) + 0.5) * self.step)
