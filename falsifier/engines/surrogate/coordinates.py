"""What the learnt dynamics predict: the outputs, or their differences if only those matter.

Examples are positions of vehicles, levels of tanks, voltages against ground. If a formula compares such
outputs only with each other, a common shift does not change its robustness, and usually not their dynamics
either. Differences stay bounded while the positions grow, and steps at different times of a trace become
similar.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Array
from falsifier.engines.surrogate.coarse import margin
from falsifier.stl.formula import Formula

# A shift by this many standard deviations must not change any margin, except for rounding.
_TRIAL_SHIFT = 3.0
_SAME = 1e-9


@dataclass(frozen=True, slots=True)
class Coordinates:
    """Linear coordinates of the outputs.

    Attributes:
        outputs: names of the recorded outputs.
        families: groups of indices into outputs that are replaced with differences of neighbours; the first
            output of a family is the reference of its shift and is not predicted.
    """

    outputs: tuple[str, ...]
    families: tuple[tuple[int, ...], ...] = ()

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.outputs) - len(self.families)

    @property
    def _differences(self) -> NDArray[np.float64]:
        """Matrix D of shape (dimension, outputs): coordinates = D outputs."""
        matrix = np.eye(len(self.outputs))
        for family in self.families:
            for before, this in pairwise(family):
                matrix[this, before] = -1.0
        return np.delete(matrix, [family[0] for family in self.families], axis=0)

    def of(self, trajectory: Trajectory) -> Array:
        """Return the coordinates of a trajectory, shape (samples, dimension)."""
        if not self.outputs:
            return np.empty((len(trajectory), 0))
        return self.transformed(np.stack([trajectory[name] for name in self.outputs], axis=1))

    def transformed(self, outputs: Array) -> Array:
        """Return the coordinates, shape (m, dimension), of outputs, shape (m, outputs)."""
        return np.asarray(outputs @ self._differences.T)

    def columns(self, values: Array) -> dict[str, Array]:
        """Return the output columns for coordinates, shape (..., dimension), with each reference set to 0."""
        outputs = values
        if self.families:
            inverse = _inverse(self).astype(values.dtype)
            outputs = (values.reshape(-1, self.dimension) @ inverse.T).reshape(*values.shape[:-1], -1)
        return {name: outputs[..., i] for i, name in enumerate(self.outputs)}


@lru_cache(maxsize=64)
def _inverse(coordinates: Coordinates) -> NDArray[np.float64]:
    """Return the matrix from coordinates to outputs whose families have a reference of 0."""
    inverse = np.linalg.pinv(coordinates._differences)
    for family in coordinates.families:
        inverse[list(family)] -= inverse[family[0]]
    return np.asarray(inverse)


def choose_coordinates(
    formula: Formula, outputs: Sequence[str], units: Mapping[str, str], trajectory: Trajectory
) -> Coordinates:
    """Find the families of outputs that the formula compares only with each other.

    A family consists of outputs with the same unit whose names differ only in digits, such as ``y1`` ...
    ``y5``.

    Args:
        formula: the requirement.
        outputs: names of the recorded outputs.
        units: known units by name.
        trajectory: any trajectory, to test whether a common shift changes a margin.
    """
    families: dict[tuple[str, str], list[int]] = {}
    for i, name in enumerate(outputs):
        families.setdefault((re.sub(r"\d+", "#", name), units.get(name, "")), []).append(i)
    named = set(formula.signals)
    relative = tuple(
        tuple(family)
        for family in families.values()
        if len(family) > 1
        and named & {outputs[i] for i in family}
        and _is_relative(formula, [outputs[i] for i in family], trajectory)
    )
    return Coordinates(tuple(outputs), relative)


def _is_relative(formula: Formula, family: Sequence[str], trajectory: Trajectory) -> bool:
    columns = dict(trajectory.columns)
    shift = _TRIAL_SHIFT * max(1.0, *(float(np.std(columns[name])) for name in family))
    moved = {**columns, **{name: columns[name] + shift for name in family}}
    for predicate in formula.predicates:
        before, after = margin(predicate, columns), margin(predicate, moved)
        if np.abs(after - before).max() > _SAME * (shift + np.abs(before).max()):
            return False
    return True
