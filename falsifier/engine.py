"""The loop: ask, simulate, judge, tell, until a requirement is violated or the budget is used up."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Literal

from falsifier.budget import Budget, Spent
from falsifier.confirm import Confirmation, confirm
from falsifier.errors import ChatError, JournalError
from falsifier.evaluation import Evaluation, evaluate
from falsifier.events import Confirmed, Evaluated, Event, Exchanged, Listener, RunEnded, RunStarted
from falsifier.execution import evaluate_all
from falsifier.journal import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    ExchangeRecord,
    Journal,
    Record,
    recorded_evaluations,
)
from falsifier.problem import Problem
from falsifier.proposers.protocol import Proposer
from falsifier.space import Candidate

if TYPE_CHECKING:
    from falsifier.llm.messages import Exchange

ResultStatus = Literal["falsified", "not falsified", "interrupted", "failed"]
OnExchange = Callable[["Exchange"], None]
ProposerBuilder = Callable[[OnExchange], Proposer]

# A model whose first simulations all fail is broken or wrongly set up; more of them would tell nothing new.
_HOPELESS = 10


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended.

    Attributes:
        problem: what was searched.
        status: ``falsified`` (a confirmed counterexample), ``not falsified`` (budget used up),
            ``interrupted`` or ``failed`` (the simulator or the language model).
        reason: in words.
        counterexample: the confirmed violation, or None.
        best: evaluation with the smallest robustness, or None when every simulation failed.
        evaluations: all evaluations in order, without trajectories except the best's.
        refuted: violations that a second simulation or the second monitor did not confirm.
        fragile: violations that vanish at half the communication step.
        spent: what the run used.
        directory: the run directory, or None.
    """

    problem: Problem
    status: ResultStatus
    reason: str
    counterexample: Confirmation | None
    best: Evaluation | None
    evaluations: tuple[Evaluation, ...]
    refuted: tuple[Confirmation, ...]
    spent: Spent
    directory: Path | None = None
    fragile: tuple[Confirmation, ...] = ()


def falsify(
    problem: Problem,
    engine: str | Proposer = "corners",
    *,
    budget: Budget | int = 100,
    seed: int = 0,
    listeners: Iterable[Listener] = (),
) -> Result:
    """Search for a violation in this process, without a record on disk.

    Args:
        problem: what to falsify.
        engine: name of a numerical engine, or any proposer.
        budget: limits; a number means simulations.
        seed: of the engine, where it is given by name.
        listeners: called with every event.

    >>> falsify(load_problem("AT1"), "corners", budget=20).status  # doctest: +SKIP
    'falsified'
    """
    from falsifier.proposers import make_proposer

    proposer = make_proposer(engine, problem, seed=seed) if isinstance(engine, str) else engine
    limits = Budget(simulations=budget) if isinstance(budget, int) else budget
    return search(problem, lambda _: proposer, limits, listeners=listeners)


def search(
    problem: Problem,
    build: ProposerBuilder,
    budget: Budget,
    *,
    batch: int = 1,
    executor: Executor | None = None,
    journal: Journal | None = None,
    records: Sequence[Record] = (),
    listeners: Iterable[Listener] = (),
) -> Result:
    """Run the loop.

    Args:
        problem: what to falsify.
        build: makes the proposer; it is handed what to call with every exchange with a language model.
        budget: limits.
        batch: how many candidates are asked for and simulated at a time.
        executor: where to simulate; None: in this process.
        journal: where to record; None: nowhere.
        records: what the journal already holds; these evaluations are told again instead of simulated again.
        listeners: called with every event.
    """
    loop = _Loop(problem, budget, journal, records, tuple(listeners))
    try:
        result = loop.run(build, batch, executor)
    except KeyboardInterrupt:
        result = loop.result("interrupted", "stopped by the user")
    except ChatError as error:
        result = loop.result("failed", str(error))
    except BaseException as error:
        loop.write_end("failed", f"{type(error).__name__}: {error}")
        raise
    loop.write_end(result.status, result.reason)
    loop.emit(RunEnded(result))
    return result


class _Loop:
    """State of one running search: the imperative shell around values and pure functions."""

    def __init__(
        self,
        problem: Problem,
        budget: Budget,
        journal: Journal | None,
        records: Sequence[Record],
        listeners: tuple[Listener, ...],
    ) -> None:
        self.problem = problem
        self.budget = budget
        self.journal = journal
        self.listeners = listeners
        self.asked = [r for r in records if isinstance(r, AskedRecord)]
        directory = journal.directory if journal else Path()
        self.recorded = dict(enumerate(recorded_evaluations(directory, list(records))))
        self.replayed_exchanges = sum(isinstance(r, ExchangeRecord) for r in records)
        self.evaluations: list[Evaluation] = []
        self.doubtful: list[Confirmation] = []
        self.best: Evaluation | None = None
        self.counterexample: Confirmation | None = None
        earlier = [r.spent.get("seconds") or 0.0 for r in records if isinstance(r, EndedRecord)]
        self.started = perf_counter() - max(earlier, default=0.0)
        self.spent = Spent()

    def run(self, build: ProposerBuilder, batch: int, executor: Executor | None) -> Result:
        proposer = build(self.exchanged)
        self.emit(RunStarted(self.problem, proposer.name, self.budget, len(self.recorded)))
        while (limit := self.budget.exceeded(self.clock())) is None:
            candidates = self.ask(proposer, batch)
            told = []
            for evaluation in self.evaluate(candidates, executor):
                told.append(evaluation)
                if evaluation.violated and self.counterexample is None:
                    self.check(len(self.evaluations) - 1, evaluation)
            if self.counterexample is not None:
                return self.result("falsified", self.counterexample.reason)
            if len(self.evaluations) >= _HOPELESS and self.best is None:
                break
            proposer.tell(told)
        if self.best is None and self.evaluations:
            count, last = len(self.evaluations), self.evaluations[-1]
            return self.result("failed", f"all {count} simulations failed; the last one: {last.reason}")
        return self.result("not falsified", limit or "")

    def ask(self, proposer: Proposer, batch: int) -> list[Candidate]:
        wanted = max(1, self.budget.remaining(self.spent, batch))
        recorded = self.asked.pop(0) if self.asked else None
        started = perf_counter()
        candidates = proposer.ask(wanted if recorded is None else recorded.n)
        seconds = perf_counter() - started
        first = len(self.evaluations)
        if recorded is None:
            self.write_asked(
                AskedRecord(
                    first=first, n=wanted, candidates=[c.to_json() for c in candidates], seconds=seconds
                )
            )
        else:
            seconds = recorded.seconds
            if [c.key for c in candidates] != [Candidate.from_json(c).key for c in recorded.candidates]:
                raise JournalError(
                    f"the proposer {proposer.name!r} does not repeat its candidate {first}: the journal was "
                    "written with other settings or another version"
                )
        self.spent = replace(self.spent, proposal_seconds=self.spent.proposal_seconds + seconds)
        return candidates

    def evaluate(self, candidates: Sequence[Candidate], executor: Executor | None) -> Iterable[Evaluation]:
        first = len(self.evaluations)
        known = [self.recorded[i] for i in range(first, first + len(candidates)) if i in self.recorded]
        for evaluation in known:
            yield self.note(self.with_trajectory(evaluation), replayed=True)
        for evaluation in evaluate_all(self.problem, candidates[len(known) :], executor):
            yield self.note(evaluation, replayed=False)

    def with_trajectory(self, evaluation: Evaluation) -> Evaluation:
        """Simulate a recorded evaluation again when its trajectory was not kept."""
        if evaluation.verdict is None or evaluation.trajectory is not None:
            return evaluation
        return replace(evaluation, trajectory=evaluate(self.problem, evaluation.candidate).trajectory)

    def note(self, evaluation: Evaluation, *, replayed: bool) -> Evaluation:
        """Count, record and announce one evaluation."""
        index = len(self.evaluations)
        improved = _smaller(evaluation, self.best)
        self.spent = replace(
            self.spent,
            simulations=self.spent.simulations + 1,
            simulation_seconds=self.spent.simulation_seconds + evaluation.seconds,
        )
        if improved:
            self.best = evaluation
        self.evaluations.append(replace(evaluation, trajectory=None))
        if self.journal is not None and not replayed:
            self.journal.evaluated(index, evaluation, improved=improved)
        self.emit(Evaluated(index, evaluation, self.best, self.clock(), replayed))
        return evaluation

    def check(self, index: int, evaluation: Evaluation) -> None:
        """Confirm a violation; a fragile or refuted one does not end the search."""
        confirmation = confirm(self.problem, evaluation)
        if confirmation.outcome == "confirmed":
            self.counterexample = confirmation
        else:
            self.doubtful.append(confirmation)
        if self.journal is not None:
            self.journal.write(
                ConfirmedRecord(
                    index=index,
                    outcome=confirmation.outcome,
                    robustness=confirmation.robustness,
                    reference=confirmation.reference,
                    reason=confirmation.reason,
                    halved=confirmation.halved,
                ),
                at_once=True,
            )
        self.emit(Confirmed(confirmation))

    def exchanged(self, exchange: "Exchange") -> None:
        """Count, record and announce an exchange with a language model."""
        usage = exchange.usage
        self.spent = self.spent.plus_call(
            prompt=usage.prompt_tokens,
            completion=usage.completion_tokens,
            reasoning=usage.reasoning_tokens,
            cost=usage.cost,
        )
        if self.replayed_exchanges:
            self.replayed_exchanges -= 1
        elif self.journal is not None:
            self.journal.write(ExchangeRecord(exchange=exchange.model_dump(mode="json")), at_once=True)
        self.emit(Exchanged(exchange, self.clock()))

    def clock(self) -> Spent:
        """What is spent by now."""
        self.spent = replace(self.spent, seconds=perf_counter() - self.started)
        return self.spent

    def emit(self, event: Event) -> None:
        for listener in self.listeners:
            listener(event)

    def write_asked(self, record: AskedRecord) -> None:
        if self.journal is not None:
            self.journal.write(record)

    def write_end(self, status: ResultStatus, reason: str) -> None:
        if self.journal is not None:
            spent = {name: getattr(self.spent, name) for name in Spent.__dataclass_fields__}
            self.journal.write(EndedRecord(status=status, reason=reason, spent=spent), at_once=True)

    def result(self, status: ResultStatus, reason: str) -> Result:
        return Result(
            self.problem,
            status,
            reason,
            self.counterexample,
            self.best,
            tuple(self.evaluations),
            tuple(c for c in self.doubtful if c.outcome == "refuted"),
            self.clock(),
            self.journal.directory if self.journal else None,
            tuple(c for c in self.doubtful if c.outcome == "fragile"),
        )


def _smaller(evaluation: Evaluation, best: Evaluation | None) -> bool:
    if evaluation.robustness is None:
        return False
    return best is None or best.robustness is None or evaluation.robustness < best.robustness
