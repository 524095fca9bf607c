"""Base of engines that search the fixed parameterization, as vectors in [0, 1]^d."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines.layout import Array, fixed_layout
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem


@dataclass(frozen=True, slots=True)
class Proposal:
    """A point in [0, 1]^d with the reason why it was chosen."""

    point: Array
    rationale: str


class BoxEngine(ABC):
    """An engine on the unit box: subclasses propose points and learn from the evaluations of points.

    Evaluations of candidates that the box cannot represent are ignored.
    """

    name: ClassVar[str]

    def __init__(self, problem: Problem, *, seed: int) -> None:
        self.box = fixed_layout(problem.space)
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
                self._learn(self.box.point(evaluation.candidate), evaluation)

    def _is_same(self, told: Array, own: Array) -> bool:
        """Whether a point that was told is one that was proposed; its candidate has settled values."""
        return bool(np.allclose(told, self.box.settled(own), rtol=0, atol=1e-9))

    @abstractmethod
    def _propose(self, rng: np.random.Generator) -> Proposal:
        """Return the next point; ``rng`` is the only source of randomness to use."""

    def _learn(self, point: Array, evaluation: Evaluation) -> None:  # noqa: B027 - some learn nothing
        """Learn from the evaluation of a point, which may have failed."""
