"""The loop: ask, simulate, judge, tell, until every requirement is falsified or the budget is used up."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import AsksLLM, Engine, FollowsRun, HasRemarks
from falsifier.errors import ChatError, SpecError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, judge
from falsifier.llm.messages import Chat, Exchange, Usage
from falsifier.problem.problem import Problem, check_limits, check_names
from falsifier.search.bounded import BoundedChat
from falsifier.search.budget import Budget, LimitReached, Spent
from falsifier.search.events import (
    Asked,
    Confirmed,
    Evaluated,
    Event,
    Exchanged,
    Listener,
    RunEnded,
    RunStarted,
)
from falsifier.search.findings import Finding
from falsifier.search.levels import Level, reached
from falsifier.search.parameterization import inexpressible
from falsifier.search.result import Result, ResultStatus
from falsifier.search.steps import Live, Steps
from falsifier.search.vacuity import Vacuity

# If this many first simulations all fail, the model is broken or set up wrongly, and the run ends.
_MAX_INITIAL_FAILURES = 10


def search(
    problems: Sequence[Problem],
    engines: Sequence[Engine],
    budget: Budget,
    *,
    steps: Steps | None = None,
    batch: int = 1,
    levels: Sequence[Level] = (),
    directory: Path | None = None,
    listeners: Iterable[Listener] = (),
) -> list[Result]:
    """Falsify one or more requirements of one system.

    Every simulation is judged against all requirements. The engines of the requirements not yet falsified
    take turns; every engine is told every simulation. A result counts the simulations until its requirement
    was falsified.

    Args:
        problems: what to falsify; they differ only in their requirement.
        engines: one per problem.
        budget: limits of the run.
        steps: how to ask, simulate and confirm; default: everything in this process.
        batch: number of candidates to ask for and simulate at a time.
        levels: the parts of the search space that the engines use, and from which simulation on; default: all
            of it.
        directory: where the run is recorded, to be stated in the results.
        listeners: called with every event.

    Returns:
        One result per problem, in their order.

    Raises:
        SpecError: if the problems differ in more than their requirement or share a name, a range exceeds the
            model's limits, or an engine returns no candidate or too many.
        CandidateError: if an engine returns a candidate outside the search space.
    """
    check_names(problems)
    check_limits(problems[0])
    for problem in problems[1:]:
        _check_alike(problems[0], problem)
    targets = [_Target(p, e) for p, e in zip(problems, engines, strict=True)]
    levels = tuple(levels) or (Level(0, problems[0].space),)
    loop = _Loop(targets, levels, budget, steps or Live(), directory, tuple(listeners))
    status: ResultStatus
    try:
        loop.attach()
        reason = loop.run(batch)
        status = "not falsified"
        if loop.spent.has_mostly_failed:
            status, reason = "failed", loop.failure_text()
    except KeyboardInterrupt:
        status, reason = "interrupted", "stopped by the user"
    except ChatError as error:
        status, reason = "failed", str(error)
        if error.lost is not None:
            loop.count_requests(error.lost.timed_out, error.lost)
    except BaseException as error:
        with suppress(Exception):  # an error in a listener must not hide the first one
            loop.end("failed", f"{type(error).__name__}: {error}")
        raise
    return loop.end(status, reason)


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


class _Loop:
    """State of a running search: the imperative shell around values and pure functions."""

    def __init__(
        self,
        targets: list[_Target],
        levels: tuple[Level, ...],
        budget: Budget,
        steps: Steps,
        directory: Path | None,
        listeners: tuple[Listener, ...],
    ) -> None:
        self.targets = targets
        self.levels = levels
        self.budget = budget
        self.steps = steps
        self.directory = directory
        self.listeners = listeners
        self.count = 0
        self.last_error = ""
        self.started = perf_counter() - steps.seconds
        self.spent = steps.unrepeated
        self.unrecorded = ""

    def attach(self) -> None:
        """Connect to the engines that ask a language model, to count and record every exchange."""

        def wrap(chat: Chat) -> Chat:
            return self.steps.chat(BoundedChat(chat, self.budget, self.clock))

        for target in self.targets:
            if isinstance(target.engine, AsksLLM):
                target.engine.attach(self.exchanged, wrap)
            if isinstance(target.engine, FollowsRun):
                target.engine.begin(self.budget.simulations)

    def run(self, batch: int) -> str:
        """Search until every requirement is falsified or a limit is reached; return why the search ended."""
        self.emit(
            RunStarted(
                problems=tuple(t.problem for t in self.targets),
                engines=tuple(t.engine.name for t in self.targets),
                budget=self.budget,
                searched=self.levels[-1].space,
                levels=self.levels if len(self.levels) > 1 else (),
                replayed=self.steps.replayed,
            )
        )
        turns = 0
        while standing := [t for t in self.targets if t.counterexample is None]:
            limit = self.budget.exceeded(self.clock())
            if limit is not None:
                return limit
            if self.count >= _MAX_INITIAL_FAILURES and self.all_failed():
                return self.failure_text()
            turn = standing[turns % len(standing)]
            turns += 1
            told: dict[str, list[Evaluation]] = {t.problem.name: [] for t in standing}
            try:
                candidates = self.ask(turn, batch)
            except LimitReached as reached:
                return self.failure_text() if self.all_failed() else str(reached)
            # One by one, as they finish: what an interruption leaves of a batch is counted and recorded.
            for evaluation in self.steps.evaluate(turn.problem, candidates):
                judged = [(t, evaluation if t is turn else judge(t.problem, evaluation)) for t in standing]
                self.note(turn, evaluation, judged)
                for target, seen in judged:
                    told[target.problem.name].append(seen)
                    self.consider(target, seen)
            started = perf_counter()
            for target in standing:
                if target.counterexample is None:
                    target.engine.tell(told[target.problem.name])
            self.think(perf_counter() - started)
        return "all requirements are falsified"

    def all_failed(self) -> bool:
        """Whether every simulation so far has failed."""
        return 0 < self.count == self.spent.failures

    def failure_text(self) -> str:
        """The reason of a run in which most simulations failed."""
        failed = f"{self.spent.failures} of {self.count} simulations"
        if self.all_failed():
            failed = "the only simulation" if self.count == 1 else f"all {self.count} simulations"
        return f"{failed} failed; the last error: {self.last_error}"

    def ask(self, target: _Target, batch: int) -> list[Candidate]:
        wanted = max(1, self.budget.remaining(self.spent, batch))
        candidates, wanted, seconds = self.steps.ask(target.problem, target.engine, wanted)
        if isinstance(target.engine, FollowsRun):
            target.engine.timed(seconds)
        self.think(seconds)
        self.emit(
            Asked(
                first=self.count,
                wanted=wanted,
                candidates=tuple(candidates),
                seconds=seconds,
                problem=target.problem,
            )
        )
        return candidates

    def think(self, seconds: float) -> None:
        """Add to the time spent in engines."""
        self.spent = replace(self.spent, engine_seconds=self.spent.engine_seconds + seconds)

    def note(
        self, turn: _Target, evaluation: Evaluation, judged: Sequence[tuple[_Target, Evaluation]]
    ) -> None:
        """Count and announce one simulation, judged against each requirement not yet falsified."""
        improved = [target.note(seen) for target, seen in judged]
        failed = all(seen.status != "ok" for _, seen in judged)
        self.last_error = evaluation.reason if failed else self.last_error
        self.spent = replace(
            self.clock(),
            simulations=self.spent.simulations + 1,
            simulation_seconds=self.spent.simulation_seconds + evaluation.seconds,
            failures=self.spent.failures + failed,
        )
        self.emit(
            Evaluated(
                index=self.count,
                problem=turn.problem,
                evaluation=evaluation,
                judged={target.problem.name: seen for target, seen in judged},
                improved=any(improved),
                best=turn.best,
                spent=self.spent,
                replayed=self.count < self.steps.replayed,
            )
        )
        self.count += 1

    def consider(self, target: _Target, evaluation: Evaluation) -> None:
        """Check a violation of one requirement; a fragile or refuted one does not end the search for it."""
        if not evaluation.violated or target.counterexample is not None:
            return
        confirmation = self.steps.confirm(target.problem, evaluation, self.count - 1)
        spent = self.clock()
        if confirmation.outcome == "confirmed":
            target.counterexample, target.spent = confirmation, spent
        else:
            target.doubtful.append(confirmation)
            if isinstance(target.engine, FollowsRun):
                target.engine.doubt(confirmation)
        event = Confirmed(index=self.count - 1, confirmation=confirmation, spent=spent)
        if all(t.counterexample is not None for t in self.targets):
            self.emit_last(event)
        else:
            self.emit(event)

    def exchanged(self, exchange: Exchange) -> None:
        """Count and announce an exchange with a language model."""
        self.count_requests(exchange.requests, exchange.usage)
        self.emit(Exchanged(exchange=exchange, spent=self.clock()))

    def count_requests(self, count: int, usage: Usage) -> None:
        """Count what was asked of a language model."""
        self.spent = self.spent.plus_requests(count, usage)

    def clock(self) -> Spent:
        """Update and return what has been spent."""
        self.spent = replace(self.spent, seconds=perf_counter() - self.started)
        return self.spent

    def emit(self, event: Event) -> None:
        for listener in self.listeners:
            listener(event)

    def emit_last(self, event: Event) -> None:
        """Announce what ends the search: it counts even if the machine can no longer record it."""
        try:
            self.emit(event)
        except OSError as error:
            self.unrecorded = self.unrecorded or str(error)

    def end(self, status: ResultStatus, reason: str) -> list[Result]:
        """Announce the end; return one result per requirement."""
        results = [self.result(target, status, reason) for target in self.targets]
        overall = "falsified" if all(r.falsified for r in results) else status
        stated = results[0].reason if len(results) == 1 else reason
        self.emit_last(RunEnded(status=overall, reason=stated, results=tuple(results), spent=self.clock()))
        return [replace(result, unrecorded=self.unrecorded) for result in results]

    def findings(self, target: _Target) -> tuple[Finding, ...]:
        """Return what the search could not show about a requirement that it did not falsify."""
        if target.best is None:
            return ()
        limits = inexpressible(target.problem, self.levels, len(target.evaluations))
        return (*target.vacuity.findings(), *([limits] if limits else []))

    def remarks(self, target: _Target) -> tuple[str, ...]:
        """Return what the engine of a requirement says of how it worked."""
        engine = target.engine
        return engine.remarks(target.evaluations) if isinstance(engine, HasRemarks) else ()

    def result(self, target: _Target, status: ResultStatus, reason: str) -> Result:
        found = target.counterexample
        begun = reached(self.levels, len(target.evaluations))
        return Result(
            problem=target.problem,
            status=status if found is None else "falsified",
            reason=reason if found is None else found.reason,
            counterexample=found,
            best=target.best,
            evaluations=tuple(target.evaluations),
            refuted=tuple(c for c in target.doubtful if c.outcome == "refuted"),
            fragile=tuple(c for c in target.doubtful if c.outcome == "fragile"),
            spent=target.spent or self.clock(),
            searched=begun[-1].space,
            levels=self.levels if len(self.levels) > 1 else (),
            findings=() if found is not None else self.findings(target),
            directory=self.directory,
            remarks=self.remarks(target),
        )


def _check_alike(one: Problem, other: Problem) -> None:
    alike = replace(other, requirement=one.requirement, source=one.source)
    if alike != one:
        raise SpecError(
            f"{one.name} and {other.name} differ in what is varied or in how it is simulated, so they cannot "
            "share a search: falsify them one after the other"
        )


def _smaller(evaluation: Evaluation, best: Evaluation | None) -> bool:
    if evaluation.robustness is None:
        return False
    return best is None or best.robustness is None or evaluation.robustness < best.robustness
