"""The loop: ask, simulate, judge, tell, until all is falsified, or nothing is left to spend or to try."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from time import perf_counter

from falsifier.core.candidate import Candidate
from falsifier.core.posix import undisturbed
from falsifier.core.words import counted
from falsifier.engines.protocol import KNOWN, RANDOM_CHANGE, AsksLLM, Engine, FollowsRun
from falsifier.errors import ChatError, SpecError, refusal
from falsifier.evaluation.evaluate import Evaluation, judge
from falsifier.llm.messages import Chat, Exchange
from falsifier.problem.problem import Problem, alike, check_limits, check_names
from falsifier.problem.source import Parameterization
from falsifier.search import events
from falsifier.search.budget import Budget, LimitReached, RunChat, Spent
from falsifier.search.parameterization import searched_space
from falsifier.search.result import RequirementState, Result, ResultStatus
from falsifier.search.steps import Steps

# If this many first simulations all fail, the model is broken or set up wrongly, and the run ends.
_MAX_INITIAL_FAILURES = 10
# In s; to see to it that a shorter simulation is recorded would cost more than to repeat one after Ctrl-C.
_WORTH_KEEPING = 0.1


def search(
    problems: Sequence[Problem],
    engines: Sequence[Engine],
    budget: Budget,
    *,
    known: Sequence[Candidate] = (),
    steps: Steps | None = None,
    jobs: int = 1,
    used: Parameterization = "free",
    directory: Path | None = None,
    listeners: Iterable[events.Listener] = (),
) -> list[Result]:
    """Falsify one or more requirements of one system.

    Every simulation is judged against all requirements. The engines of the requirements not yet falsified
    take turns; every engine is told every simulation. A result counts the simulations until its requirement
    was falsified. The problems differ only in their requirement, and each has an engine. Known candidates are
    simulated before any engine is asked, and count. ``used`` is ``fixed`` if the engines never
    choose control points. Without ``steps``, everything is done in this process. ``directory``,
    where the run is recorded, is stated in the results.

    Returns:
        One result per problem, in their order.

    Raises:
        SpecError: if the problems are not simulated alike or share a name, a range exceeds the model's
            limits, or an engine returns no candidate or too many.
        CandidateError: if an engine returns a candidate outside the search space.
    """
    check_names(problems)
    check_limits(problems[0])
    if len(groups := alike(problems)) > 1:
        raise SpecError(
            f"{groups[0][0].name} and {groups[1][0].name} differ in what is varied or in how it is simulated"
            ", so they cannot share a search: falsify them one after the other"
        )
    states = [RequirementState(*each) for each in zip(problems, engines, strict=True)]
    steps = steps or Steps()
    began = perf_counter() - steps.seconds
    first = _Known(deque(known))
    loop = _Loop(states, first, used, budget, steps, directory, tuple(listeners), began, steps.unrepeated)
    status: ResultStatus
    try:
        loop.attach()
        reason = loop.run(jobs)
        status, reason = loop.concluded(reason)
    except KeyboardInterrupt as stop:
        status, reason = "interrupted", str(stop) or "stopped by the user"
        loop.count_lost(stop)
    except ChatError as error:
        status, reason = "failed", str(error)
        loop.count_lost(error)
    except _CannotRecordError as error:
        status, reason = "failed", f"the run cannot be recorded: {error}"
    except BaseException as error:
        with suppress(Exception):  # an error in a listener must not hide the first one
            loop.end("failed", f"{type(error).__name__}: {error}")
        raise
    return loop.end(status, reason)


class _CannotRecordError(Exception):
    """The machine refuses to record what happens; what has happened until then is the result."""


# A candidate that is being simulated, or will be when it is waited for, and whose engine suggested it.
_Started = tuple[RequirementState, Callable[[], Evaluation]]


@dataclass(frozen=True, slots=True)
class _Known:
    """Proposes the candidates that a search starts from, like an engine."""

    left: deque[Candidate]
    name: str = KNOWN

    def ask(self, n: int = 1) -> list[Candidate]:
        return [self.left.popleft() for _ in range(min(n, len(self.left)))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        pass


@dataclass(slots=True)
class _Loop:
    """State of a running search: the imperative shell around values and pure functions."""

    states: list[RequirementState]
    known: _Known
    used: Parameterization
    budget: Budget
    steps: Steps
    directory: Path | None
    listeners: tuple[events.Listener, ...]
    started: float
    spent: Spent
    waiting: deque[_Started] = field(default_factory=deque)
    turns: int = 0
    count: int = 0
    last_error: str = ""
    last_defect: str = ""
    asks_llm: bool = False  # whether an engine asks a language model
    is_answered: bool = False
    server: str = ""
    unrecorded: str = ""
    # Keys of the candidates with the spec's control points, if the search space has a finite number of them.
    simulated: set[object] = field(default_factory=set)
    most: float = inf  # number of candidates of the search space

    def attach(self) -> None:
        """Connect to the engines that ask a language model, to count and record every exchange."""

        def wrap(chat: Chat) -> Chat:
            self.server = getattr(chat, "address", "")
            return RunChat(chat, self.budget, self.clock, self.steps.exchanges)

        for state in self.states:
            if isinstance(state.engine, AsksLLM):
                self.asks_llm = True
                state.engine.attach(self.exchanged, wrap)
            if isinstance(state.engine, FollowsRun):
                state.engine.begin(self.budget.simulations)

    def run(self, jobs: int) -> str:
        """Search until every requirement is falsified or a limit is reached; return why the search ended."""
        searched = searched_space(self.states[0].problem.space, self.used)
        self.most = searched.candidates
        self.emit(
            events.RunStarted(
                problems=tuple(state.problem for state in self.states),
                engines=tuple(state.engine.name for state in self.states),
                budget=self.budget,
                searched=searched,
                server=self.server,
                replayed=self.steps.replayed,
            )
        )
        while standing := [state for state in self.states if state.counterexample is None]:
            wanted = self.wanted(jobs)
            if not wanted:
                self.settle(*self.waiting.popleft(), standing)
                continue
            self.tell(standing)
            limit = self.limit_reached()
            if limit is not None:
                return limit
            if self.is_all and self.count >= self.steps.replayed:
                return f"the whole search space was simulated, {counted(int(self.most), 'candidate')}"
            if self.count >= _MAX_INITIAL_FAILURES and self.all_failed():
                return self.failure_text()
            try:
                self.ask(standing[self.turns % len(standing)], wanted)
            except LimitReached as reached:
                self.count_lost(reached.__cause__)
                self.last_defect = str(reached.__cause__ or self.last_defect)
                return self.failure_text() if self.all_failed() else str(reached)
        return "all requirements are falsified"

    @property
    def is_all(self) -> bool:
        """Whether every candidate of the search space was simulated."""
        return len(self.simulated) == self.most

    def limit_reached(self) -> str | None:
        """Which limit is reached, in words.

        The record of a run is repeated even if its time is used up, and one simulation is made however short
        it is; a language model is not asked then.
        """
        spent = self.clock()
        if self.count < self.steps.replayed or (self.count == 0 and not self.asks_llm):
            spent = replace(spent, seconds=0.0)
        return self.budget.exceeded(spent)

    def wanted(self, jobs: int) -> int:
        """Return the number of candidates to ask for now; 0: wait for the oldest simulation first.

        It depends on counts alone: a run depends on its seed and the number of jobs, not on the clock, and a
        resumed run repeats it.
        """
        # Each question costs: a language model is asked for as many candidates as are simulated at a time.
        in_batches = self.asks_llm
        waiting, limit = len(self.waiting), self.budget.simulations
        left = jobs if limit is None else limit - self.count - waiting
        if waiting and (left <= 0 or waiting >= (1 if in_batches else jobs)):
            return 0
        return max(1, min(jobs if in_batches else 1, left))

    def concluded(self, reason: str) -> tuple[ResultStatus, str]:
        """Status and reason of a search that came to its end.

        It failed if most simulations did, if there was none, or if a language model that leads it gave no
        usable answer, so that all candidates are known ones or stand-ins.
        """
        if self.spent.has_mostly_failed:
            return "failed", self.failure_text()
        if self.last_defect and not self.is_answered:
            reason = f"{reason}; the language model gave no usable answer: {self.last_defect}"
        stand_ins = (KNOWN, RANDOM_CHANGE) if self.asks_llm and not self.is_answered else ()
        evaluations = (evaluation for state in self.states for evaluation in state.evaluations)
        if all(evaluation.candidate.origin in stand_ins for evaluation in evaluations):
            return "failed", reason if self.count else f"{reason}; nothing was simulated"
        return "not falsified", reason

    def all_failed(self) -> bool:
        """Whether every simulation so far has failed."""
        return 0 < self.count == self.spent.failed

    def failure_text(self) -> str:
        """The reason of a run in which most simulations failed."""
        failed = f"{self.spent.failed} of {self.count} simulations"
        if self.all_failed():
            failed = "the only simulation" if self.count == 1 else f"all {self.count} simulations"
        return f"{failed} failed; the last error: {self.last_error}"

    def ask(self, state: RequirementState, n: int) -> None:
        """Ask for n candidates, and start to simulate them."""
        engine = self.known if self.known.left else state.engine
        started = perf_counter()
        try:
            candidates, wanted, seconds = self.steps.ask(state.problem, engine, n)
        except BaseException:  # Ctrl-C, too: the time is spent
            self.spent += Spent(engine_seconds=perf_counter() - started)
            raise
        self.turns += 1
        self.spent += Spent(engine_seconds=seconds)
        self.emit(
            events.Asked(
                first=self.count + len(self.waiting),
                wanted=wanted,
                candidates=tuple(candidates),
                seconds=seconds,
                problem=state.problem,
                spent=self.clock(),
            )
        )
        self.waiting.extend((state, wait) for wait in self.steps.start(state.problem, candidates))

    def settle(
        self, asked: RequirementState, wait: Callable[[], Evaluation], standing: Sequence[RequirementState]
    ) -> None:
        """Wait for the oldest simulation, judge it against each requirement not yet falsified, and count it.

        Simulations end in the order in which they were asked for, so that a run does not depend on which one
        is faster. Those that are still under way when the search ends are not counted.
        """
        simulated = wait()
        with undisturbed() if simulated.seconds >= _WORTH_KEEPING else nullcontext():
            # Also against the one whose engine proposed it, because a resumed run needs that verdict.
            judges = standing if asked in standing else [asked, *standing]
            known = asked if simulated.verdict is not None else None  # whose verdict it has
            judged = [(s, simulated if s is known else judge(s.problem, simulated)) for s in judges]
            evaluation = next(seen for s, seen in judged if s is asked)
            improved = [state.note(seen) for state, seen in judged if state.counterexample is None]
            failed = all(seen.status != "ok" for _, seen in judged)
            self.last_error = evaluation.reason if failed else self.last_error
            self.spent = self.clock() + Spent(
                simulations=1, simulation_seconds=evaluation.seconds, failed=int(failed)
            )
            self.emit(
                events.Evaluated(
                    index=self.count,
                    problem=asked.problem,
                    evaluation=evaluation,
                    judged={state.problem.name: seen for state, seen in judged},
                    improved=any(improved),
                    best=asked.best,
                    spent=self.spent,
                    replayed=self.count < self.steps.replayed,
                )
            )
            self.count += 1
        if self.most < inf:
            space, signals = asked.problem.space, evaluation.candidate.signals
            if all(space.is_fixed(r, signals[r.name]) for r in space.inputs):  # known ones may have others
                self.simulated.add(evaluation.candidate.key)
        for state, seen in judged:
            state.untold.append(seen)
            if seen.violated and state.counterexample is None:
                self.consider(state, seen)

    def tell(self, standing: Sequence[RequirementState]) -> None:
        """Tell the engines what was simulated since they were told last."""
        for state in standing:
            evaluations, state.untold = state.untold, []
            if evaluations:
                self.spent += Spent(engine_seconds=self.steps.tell(state.engine, evaluations))

    def consider(self, state: RequirementState, evaluation: Evaluation) -> None:
        """Check a violation of one requirement; a fragile or refuted one does not end the search for it."""
        confirmation = self.steps.confirm(state.problem, evaluation, self.count - 1)
        with undisturbed():
            spent = self.steps.spent.get((self.count - 1, state.problem.name)) or self.clock()
            if confirmation.outcome == "confirmed":
                state.counterexample, state.spent = confirmation, spent
            else:
                state.doubtful.append(confirmation)
                if isinstance(state.engine, FollowsRun):
                    state.engine.doubt(confirmation)
            is_last = all(state.counterexample is not None for state in self.states)
            emit = self.emit_last if is_last else self.emit
            emit(events.Confirmed(index=self.count - 1, confirmation=confirmation, spent=spent))

    def exchanged(self, exchange: Exchange) -> None:
        """Count and announce an exchange with a language model."""
        self.is_answered = self.is_answered or exchange.problem is None
        self.last_defect = exchange.problem or self.last_defect
        self.spent += Spent.on_requests(exchange.requests, exchange.usage)
        self.emit(events.Exchanged(exchange=exchange, spent=self.clock()))

    def count_lost(self, error: BaseException | None) -> None:
        """Count the requests that an error tells were in vain."""
        if (lost := getattr(error, "lost", None)) is not None:
            self.spent += Spent.on_requests(lost.without_reply, lost)

    def clock(self) -> Spent:
        """Update and return what has been spent; while a record is repeated, time stands still."""
        if self.count < self.steps.replayed:
            self.started = perf_counter() - self.steps.seconds
        self.spent = replace(self.spent, seconds=perf_counter() - self.started)
        return self.spent

    def emit(self, event: events.Event) -> None:
        try:
            for listener in self.listeners:
                listener(event)
        except OSError as error:
            raise _CannotRecordError(refusal(error)) from error

    def emit_last(self, event: events.Event) -> None:
        """Announce what ends the search: it counts even if the machine can no longer record it."""
        try:
            self.emit(event)
        except _CannotRecordError as error:
            self.unrecorded = self.unrecorded or str(error)

    def end(self, status: ResultStatus, reason: str) -> list[Result]:
        """Announce the end; return one result per requirement."""
        used, directory, is_all = self.used, self.directory, self.is_all
        results = [
            state.result(status, reason, used=used, spent=self.clock(), directory=directory, is_all=is_all)
            for state in self.states
        ]
        overall = "falsified" if all(r.falsified for r in results) else status
        stated = results[0].reason if len(results) == 1 else reason
        self.emit_last(
            events.RunEnded(status=overall, reason=stated, results=tuple(results), spent=self.clock())
        )
        return [replace(result, unrecorded=self.unrecorded) for result in results]
