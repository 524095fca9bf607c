"""A language model (LLM) and the surrogate engine, sharing one history.

``Turns`` decides who is next; ``design/search.md`` says why. Of several candidates of the LLM, the surrogate
predicts all before one is simulated, and uses them as starts of its own search.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.engines.layout import Array
from falsifier.engines.llm import LLMEngine, reason_in_remark
from falsifier.engines.surrogate import Settings as SurrogateSettings, Surrogate
from falsifier.engines.surrogate.planning import is_seen
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import NoValidReplyError
from falsifier.problem.problem import Problem

_LOG = logging.getLogger(__name__)
# Answers of the LLM, the first of which knows nothing of the system, before it must have helped.
_TRIAL = 2
# Factor of the surrogate's turns for each further answer that did not help: a useless LLM has few turns.
_GROWTH = 2
# An answer helps if it lowers the best robustness by at least this share; else an LLM that creeps downwards
# would keep its turns for ever.
_NOTABLE = 0.1
# Share of the best robustness by which an answer must be predicted to lower it to be simulated, unless it is
# predicted to be better than what the surrogate would do next.
_PROMISING = 0.1
# A candidate is the same experiment as a sample if it is within this share of each range of it at all times.
_SAME = 0.1
# Number of candidates requested after the first answer, which has one.
_COUNT = 5
# Number of successive predicted violations that did not occur after which predictions are no longer trusted
# and the LLM is told so.
_MOST_MISSES = 3
# Maximum number of the surrogate's latest samples of which the LLM is told the reason.
_MOST_REASONS = 4
# What the surrogate says in its reasons.
_SCALED = "scaled robustness"

# The LLM's candidates replace half of the stepping inputs and the constants between switching ones, which
# show how the system responds, but no input that may violate: it would be missed if the LLM does not help.
ADVISED = SurrogateSettings(pauses=0, probes=1)


@dataclass(slots=True)
class Turns:
    """What each half has brought, and who is next.

    The LLM answers the first and the third time: two turns on trial. Each turn after that which does not help
    multiplies the number of turns that the surrogate gets before the LLM is asked again. After an answer that
    helped, it is asked again at once.
    """

    answers: int = 0  # number of answers of the LLM
    useless: int = 0  # number of answers since the last one that helped
    waited: int = 0  # number of the surrogate's simulations since the last answer

    def answered(self, *, helped: bool) -> None:
        """Note an answer of the LLM."""
        self.answers += 1
        self.useless = 0 if helped else self.useless + 1
        self.waited = 0

    @property
    def is_llm_next(self) -> bool:
        """Whether the LLM has the next turn."""
        return self.waited >= (_GROWTH ** (self.useless - 1) if self.useless else 0)


class Hybrid:
    """The surrogate engine with a language model as adviser."""

    name = "hybrid"

    def __init__(
        self,
        problem: Problem,
        *,
        seed: int,
        adviser: LLMEngine,
        surrogate_settings: SurrogateSettings = ADVISED,
    ) -> None:
        self.adviser = adviser
        # What a run tells an engine that asks a language model concerns the adviser, which has the chat.
        self.attach, self.begin, self.doubt = adviser.attach, adviser.begin, adviser.doubt
        self.surrogate = Surrogate(problem, seed=seed, settings=surrogate_settings)
        self.turns = Turns()
        self._best: tuple[float, Candidate] | None = None
        self._since_best = 0
        self._points: list[Array] = []
        # The LLM's candidate that is being simulated, the surrogate's, and what it would simulate next.
        self._awaited: object = None
        self._own: set[object] = set()
        self._next: Candidate | None = None
        # What the LLM will be told: why the surrogate chose its samples, and what repeats a sample.
        self._reasons: list[str] = []
        self._repeats: list[str] = []
        self._unanswered: list[str] = []

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates of the LLM or the surrogate, whichever has its turn.

        Raises:
            ChatError: if the LLM cannot be reached for the first question; later, and if its replies are not
                valid, the surrogate continues without it.
        """
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell both sides the evaluations, and note what each half has brought."""
        self.surrogate.tell(evaluations)
        self.adviser.tell(evaluations)
        for evaluation in evaluations:
            self._points.append(self.surrogate.layout.point(evaluation.candidate))
            self._since_best += 1
            key, robustness = evaluation.candidate.key, evaluation.robustness
            helped = False
            if robustness is not None and (self._best is None or robustness < self._best[0]):
                # Against the best just before it: the surrogate may have improved that while it waited.
                helped = self._best is not None and helps(robustness, self._best[0])
                self._best, self._since_best = (robustness, evaluation.candidate), 0
            if key in self._own:
                self._own.discard(key)
                self.turns.waited += 1
                called = self.adviser.briefing.called(len(self._points)).capitalize()
                self._reasons.append(f"{called}: {evaluation.candidate.rationale}")
                del self._reasons[:-_MOST_REASONS]
            if key == self._awaited:
                self._awaited = None
                self.turns.answered(helped=helped)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return how many questions had no valid answer, and why."""
        if not self._unanswered:
            return ()
        questions = counted(self.turns.answers, "question")
        why = reason_in_remark(self._unanswered[-1])
        return (
            f"{len(self._unanswered)} of {questions} had no valid answer, and the surrogate continued: {why}",
        )

    def _ask_one(self) -> Candidate:
        if self._awaited is None and self.turns.is_llm_next:
            answer = self._answer()
            if answer is not None:
                self._awaited = answer.key
                if self._next is not None and self._is_same(answer, self._next):
                    self._next = None  # the LLM was told of it, and agrees
                return answer
            self.turns.answered(helped=False)
        candidate, self._next = self._next or self.surrogate.ask(1)[0], None
        self._own.add(candidate.key)
        return replace(candidate, origin=self.name, rationale=f"surrogate: {candidate.rationale}")

    def _answer(self) -> Candidate | None:
        """Ask the LLM; return its candidate that is worth a simulation, if any."""
        is_first = self.turns.answers == 0
        found: list[Candidate] = []
        try:
            found = self.adviser.propose(1) if is_first else self._advised()
        except ChatError as error:
            # The search does not need advice to continue; the LLM is asked again much later.
            if isinstance(error, NoValidReplyError):
                _LOG.warning("%s. Continuing with the surrogate.", error)
            elif is_first:
                raise
            self._unanswered.append(str(error))
        self._reasons.clear()
        return found[0] if found and (is_first or self._is_worth_simulating(found[0])) else None

    def _advised(self) -> list[Candidate]:
        """Ask for several candidates; return them, the most promising one first."""
        notes = [*self._standing(), *self._repeats, *self._reasons_told()]
        self._repeats.clear()
        candidates = self.adviser.propose(_COUNT, notes, dispensable=True)
        self.surrogate.suggest(candidates)
        predictions = self.surrogate.foresee(candidates) if self._is_trusted else []
        if not predictions:
            return sorted(candidates, key=lambda c: self._repeated(c) is not None)
        ranked = sorted(zip(predictions, candidates, strict=True), key=lambda pair: pair[0].robustness)
        return [
            replace(c, rationale=f"{c.rationale} [predicted robustness {p.robustness:.4g}]".strip())
            for p, c in ranked
        ]

    def _is_worth_simulating(self, candidate: Candidate) -> bool:
        """Whether a candidate of a later answer is simulated; of one that repeats a sample, the LLM is told.

        Predictions that have not been tested do not tell a right answer from a useless one.
        """
        repeated, is_promising = self._repeated(candidate), self._is_promising(candidate)
        if repeated is None:
            return is_promising or self.turns.answers < _TRIAL or not self._is_trusted
        if is_promising and self._is_trusted:
            return True
        briefing = self.adviser.briefing
        self._repeats.append(
            f"Your candidate ({briefing.describe(candidate)}) was not simulated: {briefing.called(repeated)} "
            f"differs from it by at most {100 * _SAME:.2g} % of each range at any time. Suggest another "
            "structure; the optimiser tunes numbers."
        )
        return False

    def _repeated(self, candidate: Candidate) -> int | None:
        """Return the number of a sample that is the same experiment as a candidate; None if there is none."""
        if not self._points:
            return None
        point = self.surrogate.layout.point(candidate)
        distances = np.abs(np.array(self._points) - point).max(axis=1, initial=0.0)
        nearest = int(np.argmin(distances))
        return nearest + 1 if distances[nearest] <= _SAME else None

    def _is_same(self, one: Candidate, other: Candidate) -> bool:
        """Whether two candidates differ by no more than the digits in which the LLM was told one of them."""
        layout = self.surrogate.layout
        return one.key == other.key or is_seen(layout.point(one), layout.point(other)[None])

    def _is_promising(self, candidate: Candidate) -> bool:
        """Whether a candidate is predicted to improve on the best sample, or to be better than the rival."""
        if self._best is None or len(self.surrogate.history.samples) < 2:
            return True
        robustness, sample = self._best
        rivals = [] if self._next is None else [self._next]
        # Against the prediction of the best sample, not its robustness: early predictions are off as a whole.
        new, best, *other = (v.robustness for v in self.surrogate.foresee([candidate, sample, *rivals]))
        return best - new >= _PROMISING * abs(robustness) or any(new < r for r in other)

    @property
    def _is_trusted(self) -> bool:
        """Whether recent predictions were good."""
        forecasts = self.surrogate.forecasts
        return forecasts.is_trusted and forecasts.misses < _MOST_MISSES

    def _standing(self) -> list[str]:
        """Return how the search stands, in the words that the LLM is told."""
        if (misses := self.surrogate.forecasts.misses) >= _MOST_MISSES:
            return [
                "A numerical optimiser shares this search and fits a model to the samples above. It "
                f"predicted a violation {misses} times in a row and was wrong each time: do "
                "not rely on small changes of the best sample, try another structure."
            ]
        if not self._since_best:
            return []
        return [
            f"The last {counted(self._since_best, 'simulation')} brought no new best: suggest other "
            "structures (which parts of the time low, high or switching); numbers are tuned later."
        ]

    def _reasons_told(self) -> list[str]:
        """Return why the surrogate chose its samples and what it would do next, in words for the LLM."""
        briefing = self.adviser.briefing
        reasons = [told for reason in self._reasons if (told := briefing.reason(reason))]
        lines = []
        if reasons:
            lines.append(f"Why the numerical optimiser that shares this search chose: {'; '.join(reasons)}.")
        self._next = self._next or self.surrogate.ask(1)[0]
        why = briefing.reason(self._next.rationale)
        because = f" ({why})" if why else ""
        lines.append(
            "The optimiser would simulate this next, if you propose nothing better: "
            f"{briefing.describe(self._next)}{because}."
        )
        if any(_SCALED in line for line in lines):
            lines.append(
                "Scaled robustness is the robustness of signals that are each divided by their spread in the "
                "samples so far; it too is below 0 for a violation."
            )
        if not self._is_trusted:
            return [
                *lines,
                "Its recent predictions were poor, or there are none yet; rely on the samples only.",
            ]
        for verdict in self.surrogate.foresee([self._next]):
            lines.append(
                f"The model that it fits to the samples expects of this: {briefing.foretold(verdict)}; "
                f"its recent predictions erred by {100 * self.surrogate.forecasts.recent_error:.2g} % of the "
                "signals' usual spread."
            )
        return lines


def helps(robustness: float, best: float) -> bool:
    """Whether a robustness is below the best one so far by a notable share of that."""
    return best - robustness >= _NOTABLE * abs(best)
