"""A language model and the surrogate engine, sharing one history.

The LLM proposes the first candidates, because its first guess is better than any corner. Later it is asked
for several candidates at a time; the surrogate ranks them by predicted robustness before any is simulated,
and uses them as starts of its own search. Before it answers, the LLM may request predictions from the
surrogate; if it does not, it is told them afterwards and may revise its candidates once. If its candidates do
not improve the result, the surrogate continues alone, with changes near the critical time. If the surrogate
does not improve the result or its predictions fail, the LLM is asked again and told why.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.engines.adviser import Adviser
from falsifier.engines.protocol import FollowsRun
from falsifier.engines.surrogate import Settings as SurrogateSettings
from falsifier.engines.surrogate import Surrogate
from falsifier.errors import ChatError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.conversation import NoValidReplyError, OnExchange
from falsifier.llm.messages import Chat
from falsifier.llm.tools import WhatIf
from falsifier.problem.problem import Problem

_LOG = logging.getLogger(__name__)

# The LLM's first candidates replace the constant extremes; one switching or stepping input is still
# informative.
ADVISED = SurrogateSettings(constants=0, bangs=1, probes=1)


@dataclass(frozen=True, slots=True)
class Settings:
    """When the LLM is asked, and how its answers are used.

    Attributes:
        opening: number of candidates of the first answer, all simulated.
        count: number of candidates requested later.
        tries: maximum number of candidates of a later answer that are simulated, best predicted first.
        patience: number of simulations without improvement after which the LLM is asked.
        patience_growth: factor of the patience after each answer without improvement, so that an LLM that
            does not help costs little.
        misses: number of successive predicted violations that did not occur after which predictions are no
            longer trusted and the LLM is told so.
        what_if: whether the LLM gets predictions of its candidates before any is simulated.
        what_if_calls: maximum number of requests for predictions per question. Each sends the whole
            conversation again, so three cost up to four requests plus rejected replies: enough to compare,
            correct and check.
    """

    opening: int = 2
    count: int = 5
    tries: int = 2
    patience: int = 4
    patience_growth: float = 2.0
    misses: int = 3
    what_if: bool = True
    what_if_calls: int = 3


@dataclass(slots=True)
class _Turn:
    """Candidates of one answer: those still to be returned by ``ask``, and those whose evaluation is due."""

    queue: list[Candidate]
    best_before: float
    asked: set[object] = field(default_factory=set)


class Hybrid:
    """The surrogate engine with a language model as adviser."""

    name = "hybrid"

    def __init__(
        self,
        problem: Problem,
        *,
        seed: int,
        adviser: Adviser,
        settings: Settings | None = None,
        surrogate_settings: SurrogateSettings = ADVISED,
    ) -> None:
        self.adviser = adviser
        self.settings = settings or Settings()
        self.surrogate = Surrogate(problem, seed=seed, settings=surrogate_settings)
        self._best = np.inf
        self._since_best = 0
        self._patience = float(self.settings.patience)
        self._turn: _Turn | None = None
        self._is_opened = False
        self._numeric: Candidate | None = None

    def attach(self, on_exchange: OnExchange, wrap: Callable[[Chat], Chat]) -> None:
        """Connect the adviser, which has the chat, to a run."""
        self.adviser.attach(on_exchange, wrap)

    def begin(self, simulations: int | None) -> None:
        """Tell the adviser the maximum number of simulations."""
        if isinstance(self.adviser, FollowsRun):
            self.adviser.begin(simulations)

    def doubt(self, confirmation: Confirmation) -> None:
        """Tell the adviser that a violation does not count."""
        if isinstance(self.adviser, FollowsRun):
            self.adviser.doubt(confirmation)

    def ask(self, n: int = 1) -> list[Candidate]:
        """Return n candidates of the LLM or the surrogate, whichever has its turn.

        Raises:
            ChatError: if the LLM cannot be reached for the first question; later, and if its replies are not
                valid, the surrogate continues without it.
        """
        return [self._ask_one() for _ in range(max(n, 1))]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Tell both sides the evaluations, and note improvements, which decide who has the next turn."""
        self.surrogate.tell(evaluations)
        self.adviser.tell(evaluations)
        for evaluation in evaluations:
            self._since_best += 1
            if self._turn is not None:
                self._turn.asked.discard(evaluation.candidate.key)
            if evaluation.robustness is not None and evaluation.robustness < self._best:
                self._best, self._since_best = evaluation.robustness, 0

    def _ask_one(self) -> Candidate:
        if not self._is_opened:
            self._is_opened = True
            try:
                opening = self.adviser.propose(self.settings.opening).candidates
                self._turn = _Turn(opening[: self.settings.opening], self._best)
            except NoValidReplyError as error:
                _LOG.warning("%s. Continuing with the surrogate.", error)
        elif self._turn is None and (reason := self._reason_to_ask()):
            self._consult(reason)
        if self._turn is not None:
            if self._turn.queue:
                candidate = self._turn.queue.pop(0)
                self._turn.asked.add(candidate.key)
                return candidate
            if not self._turn.asked:
                self._close_turn(self._turn)
        candidate, self._numeric = self._numeric or self.surrogate.ask(1)[0], None
        return replace(candidate, origin=self.name, rationale=f"surrogate: {candidate.rationale}")

    def _reason_to_ask(self) -> str:
        """Return why the LLM should be asked now, in the words it is told; empty if it should not."""
        if self._since_best < self._patience:
            return ""
        if self.surrogate.misses >= self.settings.misses:
            return (
                "A numerical optimiser shares this search and fits a model to the samples above. It "
                f"predicted a violation {self.surrogate.misses} times in a row and was wrong each time: do "
                "not rely on small changes of the best sample, try another structure."
            )
        return (
            f"The last {self._since_best} simulations, most of them chosen by a numerical optimiser that "
            "shares this search, brought no new best: suggest other structures (which parts of the time low, "
            "high or switching); numbers are tuned later."
        )

    def _consult(self, reason: str) -> None:
        """Ask the LLM, rank its candidates, and queue the most promising ones."""
        settings = self.settings
        notes = [reason, *self._prediction_notes()]
        try:
            advice = self.adviser.propose(settings.count, notes, what_if=self._offer(), dispensable=True)
            candidates = advice.candidates
            predictions = self._trusted_predictions(candidates)
            unheard = settings.what_if and not advice.foresaw
            if unheard and predictions is not None and min(predictions) >= 0:
                heard = self._predictions_told(candidates, predictions)
                revised = self.adviser.propose(settings.count, [*notes, *heard], dispensable=True)
                candidates = [*candidates, *revised.candidates]
                predictions = self._trusted_predictions(candidates)
        except ChatError:
            # The search does not need advice to continue; the LLM is asked again much later.
            self._grow_patience()
            return
        self.surrogate.suggest(candidates)
        ranked = candidates
        if predictions is not None:
            order = sorted(range(len(candidates)), key=lambda i: predictions[i])
            ranked = [_ranked(candidates[i], predictions[i]) for i in order]
        self._turn = _Turn(ranked[: settings.tries], self._best)

    def _close_turn(self, turn: _Turn) -> None:
        self._turn = None
        self._since_best = 0
        if self._best < turn.best_before:
            self._patience = float(self.settings.patience)
        else:
            self._grow_patience()

    def _grow_patience(self) -> None:
        self._patience *= self.settings.patience_growth
        self._since_best = 0

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

    def _trusted_predictions(self, candidates: Sequence[Candidate]) -> list[float] | None:
        """Return the predicted robustness of candidates; None if recent predictions were poor."""
        if not self._is_trusted:
            return None
        return [verdict.robustness for verdict in self.surrogate.foresee(candidates)] or None

    def _prediction_notes(self) -> list[str]:
        """Return what the surrogate would simulate next, and its prediction, in words for the LLM."""
        self._numeric = self._numeric or self.surrogate.ask(1)[0]
        predictions = self._trusted_predictions([self._numeric])
        if predictions is None:
            return ["The optimiser's recent predictions were poor; rely on the samples only."]
        told = self.adviser.describe(self._numeric)
        return [
            f"The optimiser would simulate this next, if you propose nothing better: {told}. The model that "
            f"it fits to the samples predicts robustness {predictions[0]:.4g}; predictions can be wrong."
        ]

    def _predictions_told(self, candidates: Sequence[Candidate], predictions: Sequence[float]) -> list[str]:
        """Return the predictions of the LLM's candidates, one line each, in words for the LLM."""
        lines = [
            f"Your candidate {i} ({self.adviser.describe(c)}) was not simulated; the optimiser's model of "
            f"the samples predicts robustness {p:.4g}."
            for i, (c, p) in enumerate(zip(candidates, predictions, strict=True), start=1)
        ]
        return [*lines, "None is predicted to violate the requirement: revise them, or insist with a reason."]


def _ranked(candidate: Candidate, prediction: float) -> Candidate:
    text = f"{candidate.rationale} [predicted robustness {prediction:.4g}]"
    return replace(candidate, rationale=text.strip())
