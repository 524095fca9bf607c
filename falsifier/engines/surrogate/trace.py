"""Simulations on the time grid of predictions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Array
from falsifier.engines.grid import Grid
from falsifier.engines.surrogate.coarse import Leaf
from falsifier.engines.surrogate.coordinates import Coordinates


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
