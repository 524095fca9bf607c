"""The cost that planning minimises on predicted traces: robustness with margins in comparable units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from falsifier.core.space import SearchSpace
from falsifier.engines.box import Array
from falsifier.engines.grid import Grid
from falsifier.engines.surrogate.coarse import CoarseFormula, Leaf, coarse_formula
from falsifier.engines.surrogate.coordinates import Coordinates
from falsifier.stl import Verdict
from falsifier.stl.formula import Formula

LeafValues = list[Array]


@dataclass(frozen=True)
class Objective:
    """Robustness of traces on the grid, each leaf shifted by its offset and divided by its scale.

    Attributes:
        space: the search space, for the ranges of inputs in the formula.
        grid: the grid of the traces.
        coordinates: the coordinates that are the states of the traces.
        formulas: the formula; if it contains discrete signals, also relaxed ones, whose mean has a slope.
        scales: scale of each leaf.
        offsets: correction of each leaf, in the leaf's own unit.
        constants: values of signals that the formula names and no candidate varies: inputs kept constant.
    """

    space: SearchSpace
    grid: Grid
    coordinates: Coordinates
    formulas: tuple[CoarseFormula, ...]
    scales: tuple[float, ...]
    offsets: tuple[float, ...]
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def leaves(self) -> tuple[Leaf, ...]:
        """Leaves of the formula."""
        return self.formulas[0].leaves

    @property
    def is_relaxed(self) -> bool:
        """Whether there are relaxed formulas, because the robustness itself has no slope."""
        return len(self.formulas) > 1

    def leaf_values(
        self,
        states: Array,
        excess: Array,
        inputs: Array,
    ) -> LeafValues:
        """Return the value of each leaf at every grid point of the horizon, shape (m, cells + 1) each.

        Args:
            states: coordinates, shape (m, cells + 1, dimension).
            excess: excess of each leaf's envelope, shape (m, cells, leaves).
            inputs: scaled inputs, shape (m, cells, inputs).
        """
        columns = self.coordinates.columns(states)
        columns |= {name: np.full(states.shape[:2], value) for name, value in self.constants.items()}
        for j, r in enumerate(self.space.inputs):
            held = np.concatenate([inputs[:, :, j], inputs[:, -1:, j]], axis=1)
            columns[r.name] = r.low + (r.high - r.low) * held
        values = []
        for i, leaf in enumerate(self.leaves):
            margin = np.broadcast_to(leaf.margin(columns), states.shape[:2])
            if leaf.envelope != "sample":
                extreme = np.minimum if leaf.envelope == "low" else np.maximum
                inside = extreme(margin[:, :-1], margin[:, 1:]) + extreme(excess[:, :, i], 0.0)
                margin = np.concatenate([inside, margin[:, -1:]], axis=1)
            values.append(margin)
        return values

    def margins(self, outputs: Array, inputs: Array) -> list[Array]:
        """Return each leaf's margin at samples, shape (m,).

        Args:
            outputs: shape (m, outputs).
            inputs: scaled inputs, shape (m, inputs).
        """
        columns = {name: outputs[:, i] for i, name in enumerate(self.coordinates.outputs)}
        columns |= {name: np.full(len(outputs), value) for name, value in self.constants.items()}
        for j, r in enumerate(self.space.inputs):
            columns[r.name] = r.low + (r.high - r.low) * inputs[:, j]
        return [np.broadcast_to(leaf.margin(columns), len(outputs)) for leaf in self.leaves]

    def scaled(self, values: LeafValues) -> LeafValues:
        """Return the leaf values after offset and scaling."""
        return [
            (value + offset) / scale
            for value, offset, scale in zip(values, self.offsets, self.scales, strict=True)
        ]

    def cost(self, values: LeafValues) -> Array:
        """Return the scaled robustness of each trace, shape (m,), given its leaf values."""
        scaled = self.scaled(values)
        return np.asarray(np.mean([formula.robustness(scaled) for formula in self.formulas], axis=0))

    def verdicts(self, values: LeafValues) -> list[Verdict]:
        """Return the verdict on each trace: this objective's cost, decided as in the unrelaxed formula."""
        deciding = self.formulas[0].deciding(self.scaled(values))
        return [
            Verdict(float(cost), self.grid.step * point, str(self.leaves[leaf].predicate))
            for cost, (leaf, point) in zip(self.cost(values), deciding, strict=True)
        ]

    def rescaled(self, seen: Sequence[LeafValues]) -> "Objective":
        """Return the objective with each leaf scaled by the standard deviation of its simulated values."""
        scales = []
        for i, leaf in enumerate(self.leaves):
            spread = float(np.std(np.concatenate([values[i] for values in seen])))
            scales.append(0.5 if leaf.discrete else max(spread, 1e-9))
        return replace(self, scales=tuple(scales))

    def plain(self) -> "Objective":
        """Return the objective in the requirement's own unit, without relaxation but with the offsets."""
        return replace(self, formulas=self.formulas[:1], scales=(1.0,) * len(self.leaves))

    def shifted(self, offsets: Sequence[float], *, limit: float) -> "Objective":
        """Return the objective with offsets, clipped to ``limit`` scales; those of discrete leaves are 0."""
        clipped = [
            0.0 if leaf.discrete else float(np.clip(offset, -limit * scale, limit * scale))
            for leaf, offset, scale in zip(self.leaves, offsets, self.scales, strict=True)
        ]
        return replace(self, offsets=tuple(clipped))


def make_objective(
    formula: Formula,
    space: SearchSpace,
    grid: Grid,
    coordinates: Coordinates,
    *,
    discrete: frozenset[str],
    stretches: Sequence[float],
    constants: Mapping[str, float],
) -> Objective:
    """Return the objective for a formula, with all scales 1 until ``rescaled``."""
    plain = coarse_formula(formula, grid.step, discrete=discrete)
    formulas = [plain]
    if any(leaf.discrete for leaf in plain.leaves):
        relaxed = [coarse_formula(formula, grid.step, discrete=discrete, stretch=s) for s in stretches]
        # Without inner windows, or with windows of the same number of cells, nothing is gained.
        formulas = list(dict.fromkeys([plain, *relaxed]))
    count = len(plain.leaves)
    return Objective(space, grid, coordinates, tuple(formulas), (1.0,) * count, (0.0,) * count, constants)
