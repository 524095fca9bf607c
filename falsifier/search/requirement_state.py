"""One requirement in a running search, up to its result."""

from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path

from falsifier.engines.protocol import Engine, HasRemarks
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.problem.source import Parameterization
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding, inexpressible
from falsifier.search.parameterization import searched_space
from falsifier.search.result import Result, ResultStatus
from falsifier.search.vacuity import Vacuity


@dataclass(slots=True)
class RequirementState:
    """One requirement in a running search."""

    problem: Problem  # what is to be falsified
    engine: Engine  # searches for a violation
    evaluations: list[Evaluation] = field(default_factory=list)  # all so far, without trajectories
    doubtful: list[Confirmation] = field(default_factory=list)  # violations that were not confirmed
    best: Evaluation | None = None  # evaluation with the smallest robustness, with its trajectory
    smallest: float = inf  # its robustness
    counterexample: Confirmation | None = None  # the confirmed violation
    spent: Spent | None = None  # what the run had spent by then
    untold: list[Evaluation] = field(default_factory=list)  # evaluations that the engine has not been told
    vacuity: Vacuity = field(init=False)

    def __post_init__(self) -> None:
        self.vacuity = Vacuity(self.problem)

    def note(self, evaluation: Evaluation) -> bool:
        """Add an evaluation; return whether it is the best so far."""
        self.vacuity.see(evaluation, len(self.evaluations))
        improved = evaluation.robustness is not None and evaluation.robustness < self.smallest
        if evaluation.robustness is not None and improved:
            self.best, self.smallest = evaluation, evaluation.robustness
        self.evaluations.append(replace(evaluation, trajectory=None))  # trajectories would fill the memory
        return improved

    def result(
        self,
        status: ResultStatus,
        reason: str,
        *,
        used: Parameterization,
        spent: Spent,
        directory: Path | None,
    ) -> Result:
        """Return the result for this requirement of a search that has ended.

        ``spent`` is the whole search's. A requirement that was falsified has its own status and reason.
        """
        found, findings = self.counterexample, list[Finding]()
        if self.best is not None and found is None:
            limits = inexpressible(self.problem, used)
            findings = [*self.vacuity.findings(), *([limits] if limits else [])]
        return Result(
            problem=self.problem,
            status=status if found is None else "falsified",
            reason=reason if found is None else found.reason,
            counterexample=found,
            best=self.best,
            evaluations=tuple(self.evaluations),
            refuted=tuple(c for c in self.doubtful if c.outcome == "refuted"),
            fragile=tuple(c for c in self.doubtful if c.outcome == "fragile"),
            spent=self.spent or spent,
            searched=searched_space(self.problem.space, used),
            findings=tuple(findings),
            directory=directory,
            remarks=self.engine.remarks(self.evaluations) if isinstance(self.engine, HasRemarks) else (),
        )
