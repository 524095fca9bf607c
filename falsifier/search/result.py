"""The result of a run for one requirement, and what is known of that requirement while the run goes on."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.core.words import counted, readable, resolving
from falsifier.engines.protocol import Engine, HasRemarks
from falsifier.errors import SpecError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.problem.source import Parameterization
from falsifier.search.budget import Spent
from falsifier.search.findings import Failure, Finding, failures, inexpressible
from falsifier.search.parameterization import searched_space
from falsifier.search.vacuity import Vacuity
from falsifier.stl.margins import signed

if TYPE_CHECKING:
    import pandas

Columns = dict[str, list[Any]]
ResultStatus = Literal["falsified", "not falsified", "interrupted", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Result:
    """The result of a run for one requirement.

    Attributes:
        problem: what was searched.
        status: ``falsified`` (a confirmed counterexample), ``not falsified`` (budget used up, or nothing left
            to try), ``interrupted`` or ``failed`` (the language model gave no usable answer, more than half
            of the simulations failed, there was none, or the run could not be recorded).
        reason: why the run ended, in words.
        counterexample: the confirmed violation, or None.
        best: evaluation with the smallest robustness, or None if every simulation failed.
        evaluations: all evaluations in order, without trajectories; ``best`` has its own.
        refuted: violations that a second simulation or the second monitor did not confirm.
        fragile: violations that disappear at half the communication step.
        spent: what the run has spent; if falsified, until the counterexample was confirmed.
        searched: the part of the search space that the engine used; None: all of it.
        findings: what the search could not show; empty if falsified.
        directory: the run directory, or None.
        remarks: what the engine says of how it worked, such as how many samples are not an LLM's.
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
        """Return the same as a data frame of pandas; SpecError if that is not installed."""
        return frame(self.columns())


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
        is_all: bool,
    ) -> Result:
        """Return the result for this requirement of a search that has ended.

        ``spent`` is the whole search's, ``is_all`` says that the whole search space was simulated. A
        requirement that was falsified has its own status and reason.
        """
        found, findings = self.counterexample, list[Finding]()
        if status == "not falsified" and (why := mostly_unjudged([e.robustness for e in self.evaluations])):
            status, reason = "failed", why
        if self.best is not None and found is None:
            limits = inexpressible(self.problem, used)
            findings = [*self.vacuity.findings(is_all=is_all), *([limits] if limits else [])]
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


def mostly_unjudged(robustness: Sequence[float | None]) -> str:
    """Say that a requirement could not be judged in more than half of the simulations; empty if it could.

    Others may have been, of the same search.
    """
    lost = sum(value is None for value in robustness)
    whole = counted(len(robustness), "simulation")
    return f"{lost} of {whole} could not be judged" if 2 * lost > len(robustness) else ""


def evaluation_columns(evaluations: Sequence[Evaluation]) -> Columns:
    """Return one row per evaluation of a run, in order, as columns of equal length.

    An input whose control points are always at the same times has one column of numbers per control point,
    named ``throttle @ 8.33 s``; a constant input and a parameter have one, named like them. An input whose
    control points move has one column of texts: ``pchip 0:0 8.33:100``, times in s before values.

    Returns:
        ``simulation`` (from 1), ``status``, ``robustness`` and ``critical_time`` in s (None without a
        verdict), ``reason`` why there is none, ``seconds`` in the simulator, ``origin`` of the candidate;
        then inputs and parameters, with ``(varied)`` after a name that is one of these.
    """
    columns: Columns = {
        "simulation": list(range(1, len(evaluations) + 1)),
        "status": [e.status for e in evaluations],
        "robustness": [e.robustness for e in evaluations],
        "critical_time": [e.verdict.critical_time if e.verdict else None for e in evaluations],
        "reason": [e.reason for e in evaluations],
        "seconds": [e.seconds for e in evaluations],
        "origin": [e.candidate.origin for e in evaluations],
    }
    varied: Columns = {}
    for name in _names(e.candidate.signals for e in evaluations):
        varied |= _signal_columns(name, [e.candidate.signals.get(name) for e in evaluations])
    for name in _names(e.candidate.parameters for e in evaluations):
        varied[name] = [e.candidate.parameters.get(name) for e in evaluations]
    return columns | {f"{n} (varied)" if n in columns else n: column for n, column in varied.items()}


def frame(columns: Columns) -> "pandas.DataFrame":
    """Return columns as a data frame of pandas; SpecError if that is not installed."""
    try:
        import pandas
    except ImportError:
        raise SpecError(
            "a data frame needs pandas: pip install 'falsifier[frames]'; columns() gives the same as lists"
        ) from None
    return pandas.DataFrame(columns)


def _names(mappings: Iterable[Mapping[str, object]]) -> list[str]:
    return list(dict.fromkeys(name for mapping in mappings for name in mapping))


def _signal_columns(name: str, signals: Sequence[Signal | None]) -> Columns:
    # Between control points, only one interpolation can be meant by numbers alone.
    shapes = {(s.times, s.interpolation if len(s.times) > 1 else "") for s in signals if s}
    if len(shapes) > 1:
        return {name: [None if signal is None else _text(signal) for signal in signals]}
    ((shared, _),) = shapes
    gap = min((b - a for a, b in pairwise(shared)), default=0.0)
    times = [readable(time, resolving(time, gap)) for time in shared]
    labels = [name] if len(shared) == 1 else [f"{name} @ {time} s" for time in times]
    return {
        label: [None if signal is None else signal.values[i] for signal in signals]
        for i, label in enumerate(labels)
    }


def _text(signal: Signal) -> str:
    points = (f"{time:.6g}:{value:.6g}" for time, value in zip(signal.times, signal.values, strict=True))
    return f"{signal.interpolation} {' '.join(points)}"
