"""Base of engines that search the fixed parameterization, as vectors in [0, 1]^d."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.space import InputRange, ParameterRange, SearchSpace, nearest_value
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# Single precision in the rollout of learnt dynamics, double precision elsewhere.
Array = NDArray[np.floating[Any]]
Vector = Array
# Engines learn from numbers up to this one: products of larger ones overflow in single precision.
_LARGEST = 1e25


def learnable(numbers: ArrayLike) -> NDArray[np.float64]:
    """Return numbers, of any shape, with infinite and huge ones cut to what can be calculated with."""
    return np.clip(np.asarray(numbers, dtype=np.float64), -_LARGEST, _LARGEST)


def settled(
    points: Array, ranges: Sequence[InputRange | ParameterRange], groups: Sequence[NDArray[np.intp]]
) -> Array:
    """Return the points, shape (..., d), that the candidates of these points have.

    Integers, Booleans and enumerations are at the nearest number, what cannot vary is at 0.

    Args:
        points: points in [0, 1]^d.
        ranges: range of each input and parameter.
        groups: indices of the coordinates of each.
    """
    result = np.array(points, dtype=np.float64)
    for r, group in zip(ranges, groups, strict=True):
        if r.low == r.high:
            result[..., group] = 0.0
        elif r.kind != "real":
            levels, which = np.unique(np.clip(result[..., group], 0.0, 1.0), return_inverse=True)
            values = [nearest_value(r, r.low + (r.high - r.low) * float(v)) for v in levels]
            scaled = (np.array(values) - r.low) / (r.high - r.low)
            result[..., group] = scaled[which].reshape(result[..., group].shape)
    return result


@dataclass(frozen=True, slots=True)
class Proposal:
    """A point with the reason why it was chosen.

    Attributes:
        point: the point in [0, 1]^d.
        rationale: the reason, in words.
    """

    point: Vector
    rationale: str


class UnitBox:
    """The search space's vector form, scaled to [0, 1]^d."""

    def __init__(self, space: SearchSpace) -> None:
        self.space = space
        bounds = space.bounds
        self.low = bounds[:, 0]
        self.span = bounds[:, 1] - bounds[:, 0]

    @property
    def dimension(self) -> int:
        """Number of coordinates d."""
        return len(self.low)

    @property
    def groups(self) -> list[NDArray[np.intp]]:
        """Indices of the coordinates of each input and each parameter, in the space's order."""
        names = [d.name for d in self.space.dimensions]
        return [np.flatnonzero([n == name for n in names]) for name in self.space.names]

    def settled(self, points: Vector) -> Vector:
        """Return the points, shape (..., d), that the candidates of these points have."""
        return settled(points, (*self.space.inputs, *self.space.parameters), self.groups)

    def candidate(self, point: Vector, *, origin: str, rationale: str) -> Candidate:
        """Return the candidate for a point, clipped to the box."""
        vector = self.low + self.span * np.clip(point, 0.0, 1.0)
        return self.space.decode(vector, origin=origin, rationale=rationale)

    def represents(self, candidate: Candidate) -> bool:
        """Whether all signals have the fixed parameterization, so that a point represents the candidate."""
        return all(self.space.is_fixed(r, candidate.signals[r.name]) for r in self.space.inputs)

    def point(self, candidate: Candidate) -> Vector:
        """Return the point for a candidate; a free signal is sampled at the fixed control points."""
        span = np.where(self.span > 0, self.span, 1.0)
        return np.clip((self.space.encode(candidate) - self.low) / span, 0.0, 1.0)


class BoxEngine(ABC):
    """An engine on the unit box: subclasses propose points and learn costs.

    The cost is the robustness; for a failed evaluation it is None. Evaluations of candidates that the box
    cannot represent are ignored.
    """

    name: ClassVar[str]

    def __init__(self, problem: Problem, *, seed: int) -> None:
        self.box = UnitBox(problem.space)
        self.seed = seed
        self._asked = 0

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return the candidates for n proposed points; the generator for each depends only on its number."""
        candidates = []
        for _ in range(max(n, 1)):
            proposal = self._propose(np.random.default_rng([self.seed, self._asked]))
            self._asked += 1
            candidates.append(
                self.box.candidate(proposal.point, origin=self.name, rationale=proposal.rationale)
            )
        return candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from the evaluations whose candidates have the fixed parameterization."""
        for evaluation in evaluations:
            if self.box.represents(evaluation.candidate):
                self._learn(self.box.point(evaluation.candidate), evaluation.robustness)

    @abstractmethod
    def _propose(self, rng: np.random.Generator) -> Proposal:
        """Return the next point; ``rng`` is the only source of randomness to use."""

    def _learn(self, point: Vector, cost: float | None) -> None:  # noqa: B027 - most engines do not learn
        """Learn the cost of a point; None if its evaluation failed."""
