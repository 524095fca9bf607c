"""The time grid of predictions, and simulations on that grid."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Array
from falsifier.engines.surrogate.coarse import Leaf
from falsifier.engines.surrogate.coordinates import Coordinates

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


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The trajectory of one simulation on the grid.

    Attributes:
        inputs: mean of each input in each cell, and the parameters, scaled to [0, 1], shape
            (all_cells, inputs + parameters).
        states: coordinates at the grid points, shape (all_cells + 1, dimension).
        excess: distance of each leaf's envelope in a cell from the extreme of its margins at the cell's ends,
            shape (all_cells, leaves); 0 for a leaf that is not an envelope.
    """

    inputs: Array
    states: Array
    excess: Array


def grid_inputs(space: SearchSpace, grid: Grid, candidate: Candidate) -> Array:
    """Return the inputs and parameters of a candidate in all cells, as in ``Trace.inputs``."""
    # Eight samples per cell, none at its ends, average a smooth signal and read a held one between switches.
    fine = (np.arange(grid.all_cells * 8) + 0.5) * grid.step / 8
    columns = []
    for r in space.inputs:
        means = candidate.signals[r.name].sample(fine).reshape(grid.all_cells, 8).mean(axis=1)
        columns.append((means - r.low) / ((r.high - r.low) or 1.0))
    for p in space.parameters:
        value = (candidate.parameters[p.name] - p.low) / ((p.high - p.low) or 1.0)
        columns.append(np.full(grid.all_cells, value))
    return np.stack(columns, axis=1)


def trace_of(
    space: SearchSpace,
    grid: Grid,
    coordinates: Coordinates,
    leaves: Sequence[Leaf],
    candidate: Candidate,
    trajectory: Trajectory,
) -> Trace:
    """Return the trace of a simulation: its trajectory on the grid."""
    points = np.round(np.arange(grid.all_cells + 1) * grid.step / trajectory.step).astype(int)
    points = np.minimum(points, len(trajectory) - 1)
    states = coordinates.of(trajectory)[points]
    excess = np.zeros((grid.all_cells, len(leaves)))
    for i, leaf in enumerate(leaves):
        if leaf.envelope == "sample":
            continue
        margins = leaf.margin(trajectory.columns)[: points[-1] + 1]
        extreme = np.minimum if leaf.envelope == "low" else np.maximum
        inside = extreme.reduceat(margins, points[:-1])[: grid.all_cells]
        ends = extreme(margins[points[:-1]], margins[points[1:]])
        excess[:, i] = extreme(inside, ends) - ends
    return Trace(grid_inputs(space, grid, candidate), states, excess)
