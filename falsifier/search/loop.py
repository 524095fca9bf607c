"""The loop: ask, simulate, judge, tell, until a requirement is violated or the budget is used up."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import Engine
from falsifier.errors import ChatError, JournalError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation, evaluate, judge
from falsifier.evaluation.workers import evaluate_all
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget, Spent
from falsifier.search.events import Confirmed, Evaluated, Event, Exchanged, Listener, RunEnded, RunStarted
from falsifier.search.journal import (
    AskedRecord,
    ConfirmedRecord,
    EndedRecord,
    ExchangeRecord,
    Journal,
    Record,
    recorded_evaluations,
)
from falsifier.search.result import Result, ResultStatus

if TYPE_CHECKING:
    from falsifier.llm.messages import Exchange

OnExchange = Callable[["Exchange"], None]
# Makes a problem's engine, which calls what it is handed with every exchange with a language model.
EngineBuilder = Callable[[Problem, OnExchange], Engine]

# A model whose first simulations all fail is broken or wrongly set up; more of them would tell nothing new.
_HOPELESS = 10


def falsify(
    problem: Problem,
    engine: str | Engine = "corners",
    *,
    budget: Budget | int = 100,
    seed: int = 0,
    listeners: Iterable[Listener] = (),
) -> Result:
    """Search for a violation in this process, without a record on disk.

    Args:
        problem: what to falsify.
        engine: name of a numerical engine, or any engine.
        budget: limits; a number means simulations.
        seed: of the engine, where it is given by name.
        listeners: called with every event.

    >>> falsify(load_problem("AT1"), "corners", budget=20).status  # doctest: +SKIP
    'falsified'
    """
    from falsifier.engines import make_engine

    found = make_engine(engine, problem, seed=seed) if isinstance(engine, str) else engine
    limits = Budget(simulations=budget) if isinstance(budget, int) else budget
    return search(problem, lambda *_: found, limits, listeners=listeners)


def search(
    problem: Problem,
    build: EngineBuilder,
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
        build: makes the engine.
        budget: limits.
        batch: how many candidates are asked for and simulated at a time.
        executor: where to simulate; None: in this process.
        journal: where to record; None: nowhere.
        records: what the journal already holds; these evaluations are told again instead of simulated again.
        listeners: called with every event.
    """
    return search_together(
        (problem,),
        build,
        budget,
        batch=batch,
        executor=executor,
        journal=journal,
        records=records,
        listeners=listeners,
    )[0]


def search_together(
    problems: Sequence[Problem],
    build: EngineBuilder,
    budget: Budget,
    *,
    batch: int = 1,
    executor: Executor | None = None,
    journal: Journal | None = None,
    records: Sequence[Record] = (),
    listeners: Iterable[Listener] = (),
) -> list[Result]:
    """Falsify several requirements of one system: every simulation is judged against all of them.

    The requirements that still hold take turns in proposing; every engine is told every simulation. A
    result counts the simulations until its requirement fell. Arguments are those of search; the problems
    differ in nothing but their requirement.

    Raises:
        SpecError: when the problems differ in what is varied or in how it is simulated.
    """
    for problem in problems[1:]:
        _check_alike(problems[0], problem)
    loop = _Loop(budget, journal, records, tuple(listeners))
    try:
        loop.targets = [_Target(problem, build(problem, loop.exchanged)) for problem in problems]
        reason = loop.run(batch, executor)
        status: ResultStatus = "failed" if loop.is_hopeless() else "not falsified"
    except KeyboardInterrupt:
        status, reason = "interrupted", "stopped by the user"
    except ChatError as error:
        status, reason = "failed", str(error)
    except BaseException as error:
        loop.write_end("failed", f"{type(error).__name__}: {error}")
        raise
    results = [loop.result(target, status, reason) for target in loop.targets]
    overall = "falsified" if all(r.status == "falsified" for r in results) else status
    loop.write_end(overall, results[0].reason if len(results) == 1 else reason)
    for result in results:
        loop.emit(RunEnded(result))
    return results


@dataclass(slots=True)
class _Target:
    """One requirement in a running search."""

    problem: Problem
    engine: Engine
    evaluations: list[Evaluation] = field(default_factory=list)
    doubtful: list[Confirmation] = field(default_factory=list)
    best: Evaluation | None = None
    counterexample: Confirmation | None = None
    spent: Spent | None = None

    @property
    def name(self) -> str:
        return self.problem.name

    def note(self, evaluation: Evaluation) -> bool:
        """Remember an evaluation; return whether it is the best so far."""
        improved = _smaller(evaluation, self.best)
        if improved:
            self.best = evaluation
        self.evaluations.append(replace(evaluation, trajectory=None))
        return improved


class _Loop:
    """State of one running search: the imperative shell around values and pure functions."""

    def __init__(
        self,
        budget: Budget,
        journal: Journal | None,
        records: Sequence[Record],
        listeners: tuple[Listener, ...],
    ) -> None:
        self.targets: list[_Target] = []
        self.budget = budget
        self.journal = journal
        self.listeners = listeners
        self.asked = [r for r in records if isinstance(r, AskedRecord)]
        directory = journal.directory if journal else Path()
        self.recorded = dict(enumerate(recorded_evaluations(directory, list(records))))
        self.confirmed = {(r.index, r.requirement) for r in records if isinstance(r, ConfirmedRecord)}
        self.replayed_exchanges = sum(isinstance(r, ExchangeRecord) for r in records)
        self.count = 0
        earlier = [r.spent.get("seconds") or 0.0 for r in records if isinstance(r, EndedRecord)]
        self.started = perf_counter() - max(earlier, default=0.0)
        self.spent = Spent()

    def run(self, batch: int, executor: Executor | None) -> str:
        """Search until nothing is left to falsify or to spend; return why it ended."""
        for target in self.targets:
            self.emit(RunStarted(target.problem, target.engine.name, self.budget, len(self.recorded)))
        turns = 0
        while standing := [t for t in self.targets if t.counterexample is None]:
            limit = self.budget.exceeded(self.clock())
            if limit is not None:
                return limit if not self.is_hopeless() else self.hopelessness()
            if self.count >= _HOPELESS and self.is_hopeless():
                return self.hopelessness()
            turn = standing[turns % len(standing)]
            turns += 1
            told: dict[str, list[Evaluation]] = {target.name: [] for target in standing}
            for evaluation, replayed in self.evaluate(turn, self.ask(turn, batch), executor):
                judged = [(t, evaluation if t is turn else judge(t.problem, evaluation)) for t in standing]
                self.note(turn, evaluation, judged, replayed=replayed)
                for target, seen in judged:
                    told[target.name].append(seen)
                    self.consider(target, seen)
            for target in standing:
                if target.counterexample is None:
                    target.engine.tell(told[target.name])
        return "all requirements are falsified"

    def is_hopeless(self) -> bool:
        """Whether no simulation has succeeded."""
        return self.count > 0 and all(t.best is None for t in self.targets)

    def hopelessness(self) -> str:
        """Say in words that every simulation failed."""
        last = self.targets[0].evaluations[-1]
        return f"all {self.count} simulations failed; the last one: {last.reason}"

    def ask(self, target: _Target, batch: int) -> list[Candidate]:
        wanted = max(1, self.budget.remaining(self.spent, batch))
        recorded = self.asked.pop(0) if self.asked else None
        started = perf_counter()
        candidates = target.engine.ask(wanted if recorded is None else recorded.n)
        seconds = perf_counter() - started
        if recorded is None:
            self.write_asked(
                AskedRecord(
                    first=self.count,
                    n=wanted,
                    candidates=[c.to_json() for c in candidates],
                    seconds=seconds,
                    requirement=self.label(target),
                )
            )
        else:
            seconds = recorded.seconds
            # Journals of earlier versions have integers as they were before rounding.
            space = target.problem.space
            known = [space.admit(Candidate.from_json(c)) for c in recorded.candidates]
            if [c.key for c in candidates] != [c.key for c in known]:
                raise JournalError(
                    f"the engine {target.engine.name!r} does not repeat its candidate {self.count}: the "
                    "journal was written with other settings or another version"
                )
        self.spent = replace(self.spent, engine_seconds=self.spent.engine_seconds + seconds)
        return candidates

    def evaluate(
        self, target: _Target, candidates: Sequence[Candidate], executor: Executor | None
    ) -> Iterable[tuple[Evaluation, bool]]:
        """Yield evaluations in the order of the candidates, each with whether it was recorded before."""
        known = [
            self.recorded[i] for i in range(self.count, self.count + len(candidates)) if i in self.recorded
        ]
        for evaluation in known:
            yield self.with_trajectory(target, evaluation), True
        for evaluation in evaluate_all(target.problem, candidates[len(known) :], executor):
            yield evaluation, False

    def with_trajectory(self, target: _Target, evaluation: Evaluation) -> Evaluation:
        """Simulate a recorded evaluation again when its trajectory was not kept."""
        if evaluation.verdict is None or evaluation.trajectory is not None:
            return evaluation
        return replace(evaluation, trajectory=evaluate(target.problem, evaluation.candidate).trajectory)

    def note(
        self,
        turn: _Target,
        evaluation: Evaluation,
        judged: Sequence[tuple[_Target, Evaluation]],
        *,
        replayed: bool,
    ) -> None:
        """Count, record and announce one simulation, judged by each requirement that stands."""
        improved = [target.note(seen) for target, seen in judged]
        self.spent = replace(
            self.spent,
            simulations=self.spent.simulations + 1,
            simulation_seconds=self.spent.simulation_seconds + evaluation.seconds,
            seconds=perf_counter() - self.started,
        )
        if self.journal is not None and not replayed:
            verdicts = {target.name: seen.verdict for target, seen in judged} if self.shared else None
            self.journal.evaluated(self.count, evaluation, improved=any(improved), verdicts=verdicts)
        self.emit(Evaluated(self.count, evaluation, turn.best, self.spent, replayed))
        self.count += 1

    def consider(self, target: _Target, evaluation: Evaluation) -> None:
        """Confirm a violation of one requirement; a fragile or refuted one does not end its search."""
        if not evaluation.violated or target.counterexample is not None:
            return
        confirmation = confirm(target.problem, evaluation)
        if confirmation.outcome == "confirmed":
            target.counterexample = confirmation
            target.spent = self.clock()
        else:
            target.doubtful.append(confirmation)
        record = ConfirmedRecord(
            index=self.count - 1,
            outcome=confirmation.outcome,
            robustness=confirmation.robustness,
            reference=confirmation.reference,
            reason=confirmation.reason,
            halved=confirmation.halved,
            requirement=self.label(target),
            spent=_amounts(self.clock()) if self.shared else None,
        )
        if self.journal is not None and (record.index, record.requirement) not in self.confirmed:
            self.journal.write(record, at_once=True)
        self.emit(Confirmed(confirmation))

    def label(self, target: _Target) -> str:
        """Name of the requirement, where a record must say which one is meant."""
        return target.name if self.shared else ""

    @property
    def shared(self) -> bool:
        """Whether several requirements are falsified together."""
        return len(self.targets) > 1

    def exchanged(self, exchange: "Exchange") -> None:
        """Count, record and announce an exchange with a language model.

        Raises:
            ChatError: when the budget is used up while the LLM is in the middle of its turn.
        """
        usage = exchange.usage
        self.spent = self.spent.plus_call(
            prompt=usage.prompt_tokens,
            completion=usage.completion_tokens,
            reasoning=usage.reasoning_tokens,
            cost=usage.cost,
        )
        replayed = self.replayed_exchanges > 0
        if replayed:
            self.replayed_exchanges -= 1
        elif self.journal is not None:
            self.journal.write(ExchangeRecord(exchange=exchange.model_dump(mode="json")), at_once=True)
        self.emit(Exchanged(exchange, self.clock()))
        goes_on = exchange.reply is not None and bool(exchange.reply.tool_calls)
        if goes_on and not replayed and (limit := self.budget.exceeded(self.clock())):
            raise ChatError(f"the LLM's turn was cut short: {limit}")

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
            record = EndedRecord(status=status, reason=reason, spent=_amounts(self.spent))
            self.journal.write(record, at_once=True)

    def result(self, target: _Target, status: ResultStatus, reason: str) -> Result:
        fallen = target.counterexample
        return Result(
            target.problem,
            status if fallen is None else "falsified",
            reason if fallen is None else fallen.reason,
            fallen,
            target.best,
            tuple(target.evaluations),
            tuple(c for c in target.doubtful if c.outcome == "refuted"),
            target.spent or self.clock(),
            self.journal.directory if self.journal else None,
            tuple(c for c in target.doubtful if c.outcome == "fragile"),
        )


def _check_alike(one: Problem, other: Problem) -> None:
    alike = replace(other, requirement=one.requirement, source=one.source)
    if alike != one:
        raise SpecError(
            f"{one.name} and {other.name} differ in what is varied or in how it is simulated: "
            "search for them one after the other"
        )


def _amounts(spent: Spent) -> dict[str, float | None]:
    return {name: getattr(spent, name) for name in Spent.__dataclass_fields__}


def _smaller(evaluation: Evaluation, best: Evaluation | None) -> bool:
    if evaluation.robustness is None:
        return False
    return best is None or best.robustness is None or evaluation.robustness < best.robustness
