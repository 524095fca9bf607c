"""An engine that searches coarse inputs first, then finer ones, and passes on what it has learnt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from falsifier.core.candidate import Candidate
from falsifier.core.fitting import fit
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import AsksLLM, Engine, FollowsRun, HasRemarks
from falsifier.errors import CandidateError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import OnExchange
from falsifier.llm.messages import Chat

# Evaluations that a level passes on, those with the smallest robustness; trajectories of more would fill the
# memory. Constant inputs are passed on beside them, because each level would simulate them first again.
_KEPT = 20
# Number of the best samples whose finer copies are simulated if a level cannot learn from them as they are.
COPIES = 2
# How often a level may suggest what is known already before that is simulated again.
_RETRIES = 20


@dataclass(frozen=True, slots=True)
class Stage:
    """One level.

    Attributes:
        engine: searches it.
        space: what it may vary.
        first: number of simulations of the run after which it begins.
    """

    engine: Engine
    space: SearchSpace
    first: int


class Refining:
    """Asks one engine after the other, each for finer inputs than the one before.

    Each is told the best samples of the levels before it; what these levels have simulated, if it was kept,
    is not simulated again.

    Args:
        stages: the levels, coarse first; the first one begins with the run.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._engines = [stage.engine for stage in stages]
        self._stage, *self._finer = stages
        self._count = self._pending = 0
        self._simulations: int | None = None
        self._best: list[Evaluation] = []
        self._constant: dict[object, Evaluation] = {}
        self._earlier: dict[object, Evaluation] = {}
        self._copies: list[Candidate] = []
        self._doubts: list[Confirmation] = []

    @property
    def name(self) -> str:
        """Name of the engine of each level."""
        return self._stage.engine.name

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return candidates of the level that it is time for, up to n, and none beyond the level's end."""
        done, wanted = self._count + self._pending, max(n, 1)
        while self._finer and done >= self._finer[0].first:
            self._refine()
        if self._finer:
            wanted = min(wanted, self._finer[0].first - done)
        candidates, self._copies = self._copies[:wanted], self._copies[wanted:]
        if len(candidates) < wanted:
            candidates += self._asked(wanted - len(candidates))
        self._pending += len(candidates)
        return candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell the engine of the current level what it can express, and keep what is worth passing on."""
        self._count += len(evaluations)
        self._pending = 0
        self._stage.engine.tell([e for e in evaluations if self._expresses(e.candidate)])
        if self._finer:
            self._keep(evaluations)

    def begin(self, simulations: int | None) -> None:
        """Tell the engine of the first level when that ends."""
        self._simulations = simulations
        self._begin(told=0)

    def doubt(self, confirmation: Confirmation) -> None:
        """Tell the engines of this level and the next ones that a violation does not count if they ask."""
        self._doubts.append(confirmation)
        if isinstance(self._stage.engine, FollowsRun):
            self._stage.engine.doubt(confirmation)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return the remarks of the engines of all levels."""
        return tuple(r for e in self._engines if isinstance(e, HasRemarks) for r in e.remarks(evaluations))

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Connect the engines to a run if they ask a language model."""
        for engine in self._engines:
            if isinstance(engine, AsksLLM):
                engine.attach(on_exchange, wrap)

    def _refine(self) -> None:
        """Go on with the next level."""
        self._stage, self._copies = self._finer.pop(0), []
        self._earlier = {_same(e.candidate): e for e in (*self._constant.values(), *self._best)}
        known = [e for e in self._earlier.values() if self._expresses(e.candidate)]
        for evaluation in self._best:
            if self._expresses(evaluation.candidate):
                continue
            why = f"one of the best samples so far, in finer pieces: {evaluation.candidate.rationale}"
            copy = replace(fit(self._stage.space, evaluation.candidate).candidate, rationale=why)
            if _same(copy) in self._earlier:
                known.append(replace(evaluation, candidate=copy))
            elif len(self._copies) < COPIES:
                self._copies.append(copy)
        self._begin(told=len(known))
        self._stage.engine.tell(known)

    def _begin(self, *, told: int) -> None:
        if isinstance(self._stage.engine, FollowsRun):
            end = self._finer[0].first if self._finer else self._simulations
            self._stage.engine.begin(None if end is None else end - self._stage.first + told)
            for confirmation in self._doubts:
                self._stage.engine.doubt(confirmation)

    def _asked(self, n: int) -> list[Candidate]:
        """Ask the engine; what earlier levels have simulated is told to it at once."""
        engine = self._stage.engine
        candidates = engine.ask(n)
        for _ in range(0 if isinstance(engine, AsksLLM) else _RETRIES):  # asking a language model costs money
            known = [c for c in candidates if _same(c) in self._earlier]
            if not known:
                break
            engine.tell([replace(self._earlier[_same(c)], candidate=c) for c in known])
            candidates = [c for c in candidates if c not in known] or engine.ask(n)
        return candidates

    def _expresses(self, candidate: Candidate) -> bool:
        """Whether the level's inputs include these, so that its engine can learn from them as they are."""
        try:
            self._stage.space.admit(candidate)
        except CandidateError:
            return False
        return True

    def _keep(self, evaluations: Sequence[Evaluation]) -> None:
        for evaluation in evaluations:
            is_constant = all(len(set(s.values)) == 1 for s in evaluation.candidate.signals.values())
            if is_constant and len(self._constant) < _KEPT:
                self._constant.setdefault(_same(evaluation.candidate), evaluation)
        judged = [e for e in (*self._best, *evaluations) if e.robustness is not None]
        self._best = sorted(judged, key=lambda e: e.robustness or 0.0)[:_KEPT]


def _same(candidate: Candidate) -> object:
    """Return what two candidates have in common if they simulate the same."""
    merged = {name: _merged(signal) for name, signal in candidate.signals.items()}
    return replace(candidate, signals=merged).key


def _merged(signal: Signal) -> Signal:
    """Return a signal without the control points that change nothing."""
    if len(set(signal.values)) == 1:
        return Signal((0.0,), signal.values[:1], "constant", signal.hold)
    if signal.interpolation != "constant":
        return signal
    values = signal.values
    kept = [i for i, value in enumerate(values) if i == 0 or value != values[i - 1]]
    times = tuple(signal.times[i] for i in kept)
    return replace(signal, times=times, values=tuple(values[i] for i in kept))
