"""A language model and the surrogate engine, sharing one history.

The LLM proposes the first candidate, because its first guess is better than any corner; the surrogate then
shows how the system responds, with an input that steps or switches. From then on the rule in
``falsifier.engines.turns`` decides who is next, from what each half has brought.

A later answer has several candidates. The surrogate predicts them before any is simulated, and uses them as
starts of its own search; the best predicted one is simulated if that is worth it, see
``turns.is_worth_simulating``. One that is the same experiment as an earlier sample is not simulated on
untested predictions, and the LLM is told so. Before it answers, the LLM is told why the surrogate chose its
samples and what it would do next, and may request predictions; if it does not, it is told them afterwards
and may revise its candidates once, or insist on some.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from textwrap import shorten

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.engines.box import Array
from falsifier.engines.llm import LLMEngine
from falsifier.engines.surrogate import Settings as SurrogateSettings
from falsifier.engines.surrogate import Surrogate
from falsifier.engines.surrogate.planning import is_seen
from falsifier.engines.turns import TRIAL, Half, Who, helps, is_worth_simulating, next_turn
from falsifier.errors import ChatError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import NoValidReplyError, OnExchange
from falsifier.llm.messages import Chat
from falsifier.llm.tools import WhatIf
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict

_LOG = logging.getLogger(__name__)
# Characters of a reason in a remark.
_LONGEST_REASON = 240
# What the surrogate says in its reasons.
_SCALED = "scaled robustness"

# The LLM's candidates replace half of the stepping inputs and the constants between switching ones, which
# show how the system responds, but no input that may violate: it would be missed if the LLM does not help.
ADVISED = SurrogateSettings(pauses=0, probes=1)


@dataclass(frozen=True, slots=True)
class Settings:
    """How the LLM is asked, and how its answers are used.

    Attributes:
        opening: number of candidates of the first answer, all simulated.
        count: number of candidates requested later.
        tries: maximum number of candidates of a later answer that are simulated, best predicted first.
        promising: share of the best robustness by which an answer must be predicted to lower it to be
            simulated, unless it is predicted to be better than what the surrogate would do next.
        same: share of each range within which a candidate is the same experiment as a sample, if it is that
            near to it in every input at all times and in every parameter.
        misses: number of successive predicted violations that did not occur after which predictions are no
            longer trusted and the LLM is told so.
        reasons: maximum number of the surrogate's latest samples of which the LLM is told the reason.
        what_if: whether the LLM gets predictions of its candidates before any is simulated.
        what_if_calls: maximum number of requests for predictions per question. Each sends the whole
            conversation again, so three cost up to four requests plus rejected replies: enough to compare,
            correct and check.
    """

    opening: int = 1
    count: int = 5
    tries: int = 1
    promising: float = 0.1
    same: float = 0.1
    misses: int = 3
    reasons: int = 4
    what_if: bool = True
    what_if_calls: int = 3


@dataclass(slots=True)
class _Answer:
    """Candidates of one answer: those still to be returned by ``ask``, and those whose evaluation is due."""

    queue: list[Candidate]
    helped: bool = False
    asked: set[object] = field(default_factory=set)


class Hybrid:
    """The surrogate engine with a language model as adviser."""

    name = "hybrid"

    def __init__(
        self,
        problem: Problem,
        *,
        seed: int,
        adviser: LLMEngine,
        settings: Settings | None = None,
        surrogate_settings: SurrogateSettings = ADVISED,
    ) -> None:
        self.adviser = adviser
        self.settings = settings or Settings()
        self.surrogate = Surrogate(problem, seed=seed, settings=surrogate_settings)
        self._llm, self._numerical = Half(), Half()
        self._best = np.inf
        self._best_candidate: Candidate | None = None
        self._since_best = self._told = 0
        self._answer: _Answer | None = None
        self._own: set[object] = set()
        self._reasons: list[str] = []
        self._numeric: Candidate | None = None
        self._unanswered: list[str] = []
        self._unrevised: list[str] = []
        self._insisted: set[object] = set()
        self._points: list[Array] = []
        self._repeats: list[str] = []

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Connect the adviser, which has the chat, to a run."""
        self.adviser.attach(on_exchange, wrap)

    def begin(self, simulations: int | None) -> None:
        """Be told the maximum number of simulations, and tell the adviser."""
        self.adviser.begin(simulations)

    def doubt(self, confirmation: Confirmation) -> None:
        """Tell the adviser that a violation does not count."""
        self.adviser.doubt(confirmation)

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
            self._note(evaluation)

    def remarks(self, evaluations: Sequence[Evaluation]) -> tuple[str, ...]:
        """Return how many questions had no valid answer, or answers no revision, and why."""
        questions = counted(self._llm.turns, "question")
        return tuple(
            f"{len(errors)} of {questions} {what}: {shorten(errors[-1], _LONGEST_REASON, placeholder=' ...')}"
            for errors, what in (
                (self._unanswered, "had no valid answer, and the surrogate continued"),
                (self._unrevised, "had no revised answer, and the first one was used"),
            )
            if errors
        )

    @property
    def next(self) -> Who:
        """Which half has the next turn."""
        return next_turn(self._llm, self._numerical)

    def _note(self, evaluation: Evaluation) -> None:
        self._told += 1
        self._points.append(self.surrogate.layout.point(evaluation.candidate))
        self._since_best += 1
        key, robustness = evaluation.candidate.key, evaluation.robustness
        helped = helps(robustness, self._best)
        if robustness is not None and robustness < self._best:
            self._best, self._since_best = robustness, 0
            self._best_candidate = evaluation.candidate
        if key in self._own:
            self._own.discard(key)
            self._numerical = self._numerical.had_turn(helped=helped)
            self._llm = self._llm.yielded()
            self._reasons.append(f"Sample {self._told}: {evaluation.candidate.rationale}")
            del self._reasons[: -self.settings.reasons]
        if self._answer is not None and key in self._answer.asked:
            # Against the best just before it: the surrogate may have improved that while the answer waited.
            self._answer.asked.discard(key)
            self._answer.helped |= helped
            if not self._answer.asked and not self._answer.queue:
                self._close(helped=self._answer.helped)

    def _ask_one(self) -> Candidate:
        if self._answer is None and self.next == "llm":
            self._question()
        answer = self._answer
        if answer is not None and answer.queue and self._is_worth_it(answer):
            candidate = answer.queue.pop(0)
            answer.asked.add(candidate.key)
            if self._numeric is not None and self._is_same(candidate, self._numeric):
                self._numeric = None  # the LLM was told of it, and agrees
            return candidate
        candidate, self._numeric = self._numeric or self.surrogate.ask(1)[0], None
        self._own.add(candidate.key)
        return replace(candidate, origin=self.name, rationale=f"surrogate: {candidate.rationale}")

    def _question(self) -> None:
        """Ask the LLM; what it brought is noted as soon as its candidates are simulated."""
        is_first = self._llm.turns == 0
        try:
            queue = self._opened() if is_first else self._advised()
        except NoValidReplyError as error:
            _LOG.warning("%s. Continuing with the surrogate.", error)
            queue = []
            self._unanswered.append(str(error))
        except ChatError as error:
            # The search does not need advice to continue; the LLM is asked again much later.
            if is_first:
                raise
            queue = []
            self._unanswered.append(str(error))
        self._reasons.clear()
        self._answer = _Answer(queue)
        if not queue:
            self._close(helped=False)

    def _close(self, *, helped: bool) -> None:
        self._answer = None
        self._llm = self._llm.had_turn(helped=helped)
        self._numerical = self._numerical.yielded()

    def _opened(self) -> list[Candidate]:
        return self.adviser.propose(self.settings.opening).candidates[: self.settings.opening]

    def _advised(self) -> list[Candidate]:
        """Ask for several candidates; return those to simulate, the most promising one first."""
        settings = self.settings
        notes = [*self._standing(), *self._repeats, *self._reasons_told()]
        self._repeats.clear()
        advice = self.adviser.propose(settings.count, notes, what_if=self._offer(), dispensable=True)
        candidates = advice.candidates
        predictions = self._trusted_predictions(candidates)
        unheard = settings.what_if and not advice.foresaw
        if unheard and predictions is not None and min(p.robustness for p in predictions) >= 0:
            heard = self._predictions_told(candidates, predictions)
            try:
                revised = self.adviser.propose(
                    settings.count, [*notes, *heard], predicted=candidates, dispensable=True
                )
            except ChatError as error:  # the first answer has been paid for
                revised = advice
                self._unrevised.append(str(error))
            candidates = list({c.key: c for c in (*candidates, *revised.candidates)}.values())
            predictions = self._trusted_predictions(candidates)
            self._insisted = {c.key for c in revised.kept}
        self.surrogate.suggest(candidates)
        if predictions is None:
            candidates = sorted(candidates, key=lambda c: self._repeated(c) is not None)
        else:
            order = sorted(range(len(candidates)), key=lambda i: predictions[i].robustness)
            candidates = [_ranked(candidates[i], predictions[i].robustness) for i in order]
        candidates.sort(key=lambda c: c.key not in self._insisted)
        return candidates[: settings.tries]

    def _is_worth_it(self, answer: _Answer) -> bool:
        """Whether the next candidate of an answer is simulated; drop it if not."""
        if self._llm.turns == 0:
            return True
        candidate = answer.queue[0]
        if candidate.key in self._insisted:
            return True
        repeated = self._repeated(candidate)
        if is_worth_simulating(
            repeats=repeated is not None,
            promising=self._is_promising(candidate),
            trusted=self._is_trusted,
            on_trial=self._llm.turns < TRIAL,
        ):
            return True
        if repeated is not None:
            self._repeats.append(self._repeat_told(candidate, repeated))
        answer.queue.clear()
        if not answer.asked:
            self._close(helped=False)
        return False

    def _repeated(self, candidate: Candidate) -> int | None:
        """Return the number of a sample that is the same experiment as a candidate; None if there is none."""
        if not self._points:
            return None
        point = self.surrogate.layout.point(candidate)
        distances = np.abs(np.array(self._points) - point).max(axis=1, initial=0.0)
        nearest = int(np.argmin(distances))
        return nearest + 1 if distances[nearest] <= self.settings.same else None

    def _is_same(self, one: Candidate, other: Candidate) -> bool:
        """Whether two candidates differ by no more than the digits in which the LLM was told one of them."""
        layout = self.surrogate.layout
        return one.key == other.key or is_seen(layout.point(one), layout.point(other)[None])

    def _repeat_told(self, candidate: Candidate, sample: int) -> str:
        return (
            f"Your candidate ({self.adviser.describe(candidate)}) was not simulated: sample {sample} differs "
            f"from it by at most {100 * self.settings.same:.2g} % of each range at any time. Suggest another "
            "structure; the optimiser tunes numbers."
        )

    def _is_promising(self, candidate: Candidate) -> bool:
        """Whether a candidate is predicted to improve on the best sample, or to be better than the rival."""
        if self._best_candidate is None or len(self.surrogate.history.samples) < 2:
            return True
        rivals = [] if self._numeric is None else [self._numeric]
        # Against the prediction of the best sample, not its robustness: early predictions are off as a whole.
        new, best, *other = (
            v.robustness for v in self.surrogate.foresee([candidate, self._best_candidate, *rivals])
        )
        return best - new >= self.settings.promising * abs(self._best) or any(new < r for r in other)

    def _standing(self) -> list[str]:
        """Return how the search stands, in the words that the LLM is told."""
        if self.surrogate.misses >= self.settings.misses:
            return [
                "A numerical optimiser shares this search and fits a model to the samples above. It "
                f"predicted a violation {self.surrogate.misses} times in a row and was wrong each time: do "
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
        adviser = self.adviser
        reasons = [told for reason in self._reasons if (told := adviser.told(reason))]
        lines = []
        if reasons:
            lines.append(f"Why the numerical optimiser that shares this search chose: {'; '.join(reasons)}.")
        self._numeric = self._numeric or self.surrogate.ask(1)[0]
        why = adviser.told(self._numeric.rationale)
        because = f" ({why})" if why else ""
        lines.append(
            "The optimiser would simulate this next, if you propose nothing better: "
            f"{adviser.describe(self._numeric)}{because}."
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
        for verdict in self.surrogate.foresee([self._numeric]):
            lines.append(
                f"The model that it fits to the samples expects of this: {adviser.foretold(verdict)}; "
                f"its recent predictions erred by {100 * self.surrogate.recent_error:.2g} % of the signals' "
                "usual spread."
            )
        return lines

    @property
    def _is_trusted(self) -> bool:
        """Whether recent predictions were good."""
        return self.surrogate.is_trusted and self.surrogate.misses < self.settings.misses

    def _offer(self) -> WhatIf | None:
        """Return the permission to request predictions; None if they are disabled or not trusted."""
        settings = self.settings
        if not (settings.what_if and settings.what_if_calls and self._is_trusted):
            return None
        return WhatIf(self.surrogate, settings.what_if_calls)

    def _trusted_predictions(self, candidates: Sequence[Candidate]) -> list[Verdict] | None:
        """Return the predicted verdicts on candidates; None if recent predictions were poor."""
        if not self._is_trusted:
            return None
        return self.surrogate.foresee(candidates) or None

    def _predictions_told(self, candidates: Sequence[Candidate], predictions: Sequence[Verdict]) -> list[str]:
        """Return the predictions of the LLM's candidates, one line each, in words for the LLM."""
        lines = [
            f"Your candidate {i} ({self.adviser.describe(c)}) was not simulated; the optimiser's model of "
            f"the samples says: {self.adviser.foretold(p)}."
            for i, (c, p) in enumerate(zip(candidates, predictions, strict=True), start=1)
        ]
        return [
            *lines,
            "None is predicted to violate the requirement: revise them, or insist on some as they are by "
            'adding their numbers to your reply, such as "keep": [1], and say why.',
        ]


def _ranked(candidate: Candidate, prediction: float) -> Candidate:
    text = f"{candidate.rationale} [predicted robustness {prediction:.4g}]"
    return replace(candidate, rationale=text.strip())
