"""What a running search knows of one of its requirements."""

from dataclasses import dataclass, field, replace

from falsifier.engines.protocol import Engine, HasRemarks
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding, inexpressible
from falsifier.search.levels import Level
from falsifier.search.vacuity import Vacuity


@dataclass(slots=True)
class RequirementState:
    """One requirement in a running search.

    Attributes:
        problem: what is to be falsified.
        engine: searches for a violation.
        evaluations: all so far, without trajectories.
        doubtful: violations that were not confirmed.
        best: evaluation with the smallest robustness, with its trajectory.
        counterexample: the confirmed violation.
        spent: what the run had spent by then.
        untold: evaluations that the engine has not been told.
    """

    problem: Problem
    engine: Engine
    evaluations: list[Evaluation] = field(default_factory=list)
    doubtful: list[Confirmation] = field(default_factory=list)
    best: Evaluation | None = None
    counterexample: Confirmation | None = None
    spent: Spent | None = None
    untold: list[Evaluation] = field(default_factory=list)
    vacuity: Vacuity = field(init=False)

    def __post_init__(self) -> None:
        self.vacuity = Vacuity(self.problem)

    def note(self, evaluation: Evaluation) -> bool:
        """Add an evaluation; return whether it is the best so far."""
        self.vacuity.see(evaluation, len(self.evaluations))
        improved = _smaller(evaluation, self.best)
        if improved:
            self.best = evaluation
        self.evaluations.append(replace(evaluation, trajectory=None))  # trajectories would fill the memory
        return improved

    def findings(self, levels: tuple[Level, ...]) -> tuple[Finding, ...]:
        """Return what the search could not show about a requirement that it did not falsify."""
        if self.best is None:
            return ()
        limits = inexpressible(self.problem, levels, len(self.evaluations))
        return (*self.vacuity.findings(), *([limits] if limits else []))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the engine says of how it worked."""
        return self.engine.remarks(self.evaluations) if isinstance(self.engine, HasRemarks) else ()


def _smaller(evaluation: Evaluation, best: Evaluation | None) -> bool:
    if evaluation.robustness is None:
        return False
    return best is None or best.robustness is None or evaluation.robustness < best.robustness
