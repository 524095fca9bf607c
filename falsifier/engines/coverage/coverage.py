"""The coverage engine: leads the search by what trajectories did that no earlier one did."""

from collections.abc import Iterator, Sequence

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines.coverage.explorer import Explorer, Idea
from falsifier.engines.layout import TimeGrid, planning_layout
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

# Ideas, then random points, among which one that was not simulated is looked for.
_IDEAS, _DRAWS = 10, 100


class Coverage:
    """Collects inputs that reached something new, and goes on from these; robustness is not used."""

    name = "coverage"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        self.layout = planning_layout(problem.space, TimeGrid.of(problem))
        self.seed = seed
        self._explorer = Explorer(problem, self.layout)
        self._known: set[int] = set()
        self._asked = 0

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates."""
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Add the trajectories to what was reached."""
        for evaluation in evaluations:
            self.avoid(evaluation.candidate)
            if evaluation.trajectory is not None:
                point = self.layout.point(evaluation.candidate)
                self._explorer.learn(point, evaluation.trajectory, 0.0, 0.0)

    def avoid(self, candidate: Candidate) -> None:
        """Do not propose a candidate, because it is about to be simulated."""
        self._known.add(hash(candidate.key))

    def avoids(self, candidate: Candidate) -> bool:
        """Whether a candidate was simulated or is about to be."""
        return hash(candidate.key) in self._known

    def _ask_one(self) -> Candidate:
        ideas = self._ideas(np.random.default_rng([self.seed, self._asked]))
        self._asked += 1
        for idea in ideas:
            candidate = self.layout.candidate(idea.point, origin=self.name, rationale=idea.why)
            if not self.avoids(candidate):
                break
        self.avoid(candidate)
        return candidate

    def _ideas(self, rng: np.random.Generator) -> Iterator[Idea]:
        for _ in range(_IDEAS):
            yield self._explorer.propose(rng)
        for _ in range(_DRAWS):
            point = self.layout.settled(rng.random(self.layout.dimension))
            yield Idea(point, "random: all other ideas were simulated")
