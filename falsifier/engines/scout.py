"""Cheap proposals for cores, or a share of the time, that would otherwise wait for an engine that thinks."""

from collections.abc import Iterator, Sequence
from itertools import cycle, islice

from falsifier.core.candidate import Candidate
from falsifier.engines.cma import CMA
from falsifier.engines.corners import Corners
from falsifier.engines.coverage import Coverage
from falsifier.engines.protocol import Engine
from falsifier.engines.sobol import Sobol
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem


class Scout:
    """Extremes, spread points, changes of good inputs and of inputs that reached something new, in turn.

    A proposal takes each of them less than a millisecond. Learning from a simulation takes one to three,
    nearly all of it to find what the trajectory did. None of the four fits every system, so each gets the
    same share.
    """

    name = "scout"

    def __init__(self, problem: Problem, *, seed: int) -> None:
        self._coverage, self._strategy = Coverage(problem, seed=seed), CMA(problem, seed=seed)
        self._members: tuple[Engine, ...] = (
            Corners(problem, seed=seed),
            self._coverage,
            self._strategy,
            Sobol(problem, seed=seed),
        )
        self._turns: Iterator[Engine] = cycle(self._members)

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates; the origin of each says which member proposed it."""
        return [self._ask_one(member) for member in islice(self._turns, max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell every member."""
        for member in self._members:
            member.tell(evaluations)

    def _ask_one(self, member: Engine) -> Candidate:
        """Return the member's candidate; if it was simulated already, one of coverage."""
        (candidate,) = member.ask(1)
        # The evolution strategy waits for the evaluations of all its points.
        if member not in (self._coverage, self._strategy) and self._coverage.avoids(candidate):
            (candidate,) = self._coverage.ask(1)
        self._coverage.avoid(candidate)
        return candidate
