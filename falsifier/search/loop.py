"""The loop: ask, simulate, judge, tell, until every requirement is violated or the budget is used up."""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Protocol

from falsifier.core.candidate import Candidate
from falsifier.engines.protocol import AsksLLM, Engine
from falsifier.errors import ChatError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm
from falsifier.evaluation.evaluate import Evaluation, judge
from falsifier.evaluation.workers import evaluate_all
from falsifier.llm.messages import Chat, Exchange
from falsifier.problem.problem import Problem
from falsifier.search.budget import Budget, Spent
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
from falsifier.search.result import Result, ResultStatus

# A model whose first simulations all fail is broken or wrongly set up; more of them would tell nothing new.
_HOPELESS = 10


class Steps(Protocol):
    """What the loop has done for it: by engines, models and monitors, or from a record."""

    @property
    def replayed(self) -> int:
        """How many evaluations come from a record."""
        ...

    @property
    def seconds(self) -> float:
        """Wall-clock seconds that the recorded part of the run took."""
        ...

    def ask(self, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Candidates of an engine, how many were asked for, and how long that took in s."""
        ...

    def evaluate(self, problem: Problem, candidates: Sequence[Candidate]) -> Iterator[Evaluation]:
        """Yield the candidates' evaluations in their order."""
        ...

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Check a violation, given the index of its evaluation."""
        ...

    def chat(self, inner: Chat) -> Chat:
        """The chat that an engine asks."""
        ...


@dataclass(frozen=True, slots=True)
class Live:
    """Everything is done now.

    Attributes:
        executor: where to simulate; None: in this process.
    """

    executor: Executor | None = None
    replayed: int = 0
    seconds: float = 0.0

    def ask(self, engine: Engine, wanted: int) -> tuple[list[Candidate], int, float]:
        """Ask the engine."""
        started = perf_counter()
        candidates = engine.ask(wanted)
        return candidates, wanted, perf_counter() - started

    def evaluate(self, problem: Problem, candidates: Sequence[Candidate]) -> Iterator[Evaluation]:
        """Simulate and judge."""
        return evaluate_all(problem, candidates, self.executor)

    def confirm(self, problem: Problem, evaluation: Evaluation, index: int) -> Confirmation:
        """Simulate again."""
        return confirm(problem, evaluation)

    def chat(self, inner: Chat) -> Chat:
        """Ask the chat itself."""
        return inner


def search(
    problems: Sequence[Problem],
    engines: Sequence[Engine],
    budget: Budget,
    *,
    steps: Steps | None = None,
    batch: int = 1,
    directory: Path | None = None,
    listeners: Iterable[Listener] = (),
) -> list[Result]:
    """Falsify several requirements of one system; one is the case of a list of one.

    Every simulation is judged against all requirements. Those that are not falsified yet take turns in
    asking; every engine is told every simulation. A result counts the simulations until its requirement was
    falsified.

    Args:
        problems: what to falsify; they differ in nothing but their requirement.
        engines: one for each problem.
        budget: limits of the run.
        steps: who asks, simulates and confirms; default: everything is done in this process.
        batch: how many candidates are asked for and simulated at a time.
        directory: where the run is recorded, for the results.
        listeners: called with every event.

    Raises:
        SpecError: when the problems differ in what is varied or in how it is simulated.
    """
    for problem in problems[1:]:
        _check_alike(problems[0], problem)
    loop = _Loop(budget, steps or Live(), directory, tuple(listeners))
    loop.targets = [_Target(p, e) for p, e in zip(problems, engines, strict=True)]
    status: ResultStatus
    try:
        loop.attach()
        reason = loop.run(batch)
        status = "failed" if loop.is_hopeless() else "not falsified"
    except KeyboardInterrupt:
        status, reason = "interrupted", "stopped by the user"
    except ChatError as error:
        status, reason = "failed", str(error)
    except BaseException as error:
        with suppress(Exception):  # the first error is the one to hear of
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
        self, budget: Budget, steps: Steps, directory: Path | None, listeners: tuple[Listener, ...]
    ) -> None:
        self.targets: list[_Target] = []
        self.budget = budget
        self.steps = steps
        self.directory = directory
        self.listeners = listeners
        self.count = 0
        self.started = perf_counter() - steps.seconds
        self.spent = Spent()

    def attach(self) -> None:
        """Hear of every exchange of engines that ask a language model."""
        for target in self.targets:
            if isinstance(target.engine, AsksLLM):
                target.engine.attach(self.exchanged, self.steps.chat)

    def run(self, batch: int) -> str:
        """Search until nothing is left to falsify or to spend; return why it ended."""
        self.emit(
            RunStarted(
                problems=tuple(t.problem for t in self.targets),
                engines=tuple(t.engine.name for t in self.targets),
                budget=self.budget,
                replayed=self.steps.replayed,
            )
        )
        turns = 0
        while standing := [t for t in self.targets if t.counterexample is None]:
            limit = self.budget.exceeded(self.clock())
            if limit is not None or self.count >= _HOPELESS:
                if self.is_hopeless():
                    return self.hopelessness()
                if limit is not None:
                    return limit
            turn = standing[turns % len(standing)]
            turns += 1
            told: dict[str, list[Evaluation]] = {t.problem.name: [] for t in standing}
            for evaluation in self.steps.evaluate(turn.problem, self.ask(turn, batch)):
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

    def is_hopeless(self) -> bool:
        """Whether no simulation has succeeded."""
        return self.count > 0 and all(t.best is None for t in self.targets)

    def hopelessness(self) -> str:
        """Say in words that every simulation failed."""
        last = self.targets[0].evaluations[-1]
        return f"all {self.count} simulations failed; the last one: {last.reason}"

    def ask(self, target: _Target, batch: int) -> list[Candidate]:
        wanted = max(1, self.budget.remaining(self.spent, batch))
        candidates, wanted, seconds = self.steps.ask(target.engine, wanted)
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
        """Count seconds of engines."""
        self.spent = replace(self.spent, engine_seconds=self.spent.engine_seconds + seconds)

    def note(
        self, turn: _Target, evaluation: Evaluation, judged: Sequence[tuple[_Target, Evaluation]]
    ) -> None:
        """Count and announce one simulation, judged by each requirement that is not falsified yet."""
        improved = [target.note(seen) for target, seen in judged]
        self.spent = replace(
            self.clock(),
            simulations=self.spent.simulations + 1,
            simulation_seconds=self.spent.simulation_seconds + evaluation.seconds,
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
        """Confirm a violation of one requirement; a fragile or refuted one does not end its search."""
        if not evaluation.violated or target.counterexample is not None:
            return
        confirmation = self.steps.confirm(target.problem, evaluation, self.count - 1)
        spent = self.clock()
        if confirmation.outcome == "confirmed":
            target.counterexample, target.spent = confirmation, spent
        else:
            target.doubtful.append(confirmation)
        self.emit(Confirmed(index=self.count - 1, confirmation=confirmation, spent=spent))

    def exchanged(self, exchange: Exchange) -> None:
        """Count and announce an exchange with a language model.

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
        self.emit(Exchanged(exchange=exchange, spent=self.clock()))
        goes_on = exchange.reply is not None and bool(exchange.reply.tool_calls)
        is_new = exchange.reply is not None and exchange.reply.source != "recording"
        if goes_on and is_new and (limit := self.budget.exceeded(self.clock())):
            raise ChatError(f"the LLM's turn was cut short: {limit}")

    def clock(self) -> Spent:
        """What is spent by now."""
        self.spent = replace(self.spent, seconds=perf_counter() - self.started)
        return self.spent

    def emit(self, event: Event) -> None:
        for listener in self.listeners:
            listener(event)

    def end(self, status: ResultStatus, reason: str) -> list[Result]:
        """Announce the end; return how it ended for each requirement."""
        results = [self.result(target, status, reason) for target in self.targets]
        overall = "falsified" if all(r.falsified for r in results) else status
        said = results[0].reason if len(results) == 1 else reason
        self.emit(RunEnded(status=overall, reason=said, results=tuple(results), spent=self.clock()))
        return results

    def result(self, target: _Target, status: ResultStatus, reason: str) -> Result:
        found = target.counterexample
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
            directory=self.directory,
        )


def _check_alike(one: Problem, other: Problem) -> None:
    alike = replace(other, requirement=one.requirement, source=one.source)
    if alike != one:
        raise SpecError(
            f"{one.name} and {other.name} differ in what is varied or in how it is simulated: "
            "search for them one after the other"
        )


def _smaller(evaluation: Evaluation, best: Evaluation | None) -> bool:
    if evaluation.robustness is None:
        return False
    return best is None or best.robustness is None or evaluation.robustness < best.robustness
