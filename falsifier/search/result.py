"""The result of a run."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from falsifier.core.space import SearchSpace
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.table import Columns, evaluation_columns
from falsifier.evaluation.table import frame as as_frame
from falsifier.problem.problem import Problem
from falsifier.search.budget import Spent
from falsifier.search.findings import Failure, Finding, failures
from falsifier.search.levels import Level
from falsifier.stl.margins import signed

if TYPE_CHECKING:
    import pandas

ResultStatus = Literal["falsified", "not falsified", "interrupted", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Result:
    """The result of a run for one requirement.

    Attributes:
        problem: what was searched.
        status: ``falsified`` (a confirmed counterexample), ``not falsified`` (budget used up),
            ``interrupted`` or ``failed`` (the language model gave no usable answer, more than half of the
            simulations failed, or there was none).
        reason: why the run ended, in words.
        counterexample: the confirmed violation, or None.
        best: evaluation with the smallest robustness, or None if every simulation failed.
        evaluations: all evaluations in order, without trajectories; ``best`` has its own.
        refuted: violations that a second simulation or the second monitor did not confirm.
        fragile: violations that disappear at half the communication step.
        spent: what the run has spent; if falsified, until the counterexample was confirmed.
        searched: the part of the search space that the engine used; None: all of it.
        levels: if the inputs are refined step by step: all levels, coarse first.
        findings: what the search could not show; empty if falsified.
        directory: the run directory, or None.
        remarks: what the engine says of how it worked, such as how many samples are a fallback's.
        unrecorded: why the end of the run could not be recorded, such as a full disk; empty if it was.
    """

    problem: Problem
    status: ResultStatus
    reason: str
    counterexample: Confirmation | None = None
    best: Evaluation | None = None
    evaluations: tuple[Evaluation, ...] = ()
    refuted: tuple[Confirmation, ...] = ()
    fragile: tuple[Confirmation, ...] = ()
    spent: Spent = field(default_factory=Spent)
    searched: SearchSpace | None = None
    levels: tuple[Level, ...] = ()
    findings: tuple[Finding, ...] = ()
    directory: Path | None = None
    unrecorded: str = ""
    remarks: tuple[str, ...] = ()

    def __repr__(self) -> str:
        # All trajectories and variables would fill pages of a terminal.
        least = "" if self.robustness is None else f", robustness {signed(self.robustness)}"
        return f"Result({self.problem.name}: {self.status}{least}, {self.spent.simulations_text})"

    @property
    def falsified(self) -> bool:
        """Whether a confirmed counterexample was found."""
        return self.counterexample is not None

    @property
    def failures(self) -> tuple[Failure, ...]:
        """Why simulations failed, by cause."""
        return failures((i, e.reason) for i, e in enumerate(self.evaluations) if e.status != "ok")

    @property
    def shown(self) -> Evaluation | None:
        """The evaluation to show: the counterexample's, otherwise the best one."""
        return self.best if self.counterexample is None else self.counterexample.evaluation

    @property
    def robustness(self) -> float | None:
        """Robustness of the counterexample, otherwise the smallest; None if every simulation failed."""
        return None if self.shown is None else self.shown.robustness

    def columns(self) -> Columns:
        """Return one row per evaluation, as columns of equal length; see evaluation_columns."""
        return evaluation_columns(self.evaluations)

    def frame(self) -> "pandas.DataFrame":
        """Return the same as a data frame of pandas.

        Raises:
            SpecError: if pandas is not installed.
        """
        return as_frame(self.columns())
