"""The rules by which the hybrid engine decides which half has the next turn, and when an answer is simulated.

The turn depends on three things: how many turns each half has had, how many of them brought a new best, and
what a turn of each half costs. The language model (LLM) has the next turn once the surrogate has had so many
turns that they cost as much as the LLM's would. Two turns of the LLM are on trial. Each turn after that which
does not help multiplies the number of turns that the surrogate gets before the LLM is asked again, and then
these must have brought nothing new either. After an answer that helped, it is asked again sooner.

If a question costs little compared with a simulation, the LLM therefore answers the first and the third time,
or at once as long as its answers help. If a question costs as much as a hundred simulations, the surrogate
gets these first. As simulations are limited too, the surrogate's wait is limited to a share of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Literal

from falsifier.llm.messages import Exchange

Who = Literal["llm", "surrogate"]
Due = Literal["now", "later", "never"]

# Answers of the LLM, the first of which knows nothing of the system, before it must have helped.
TRIAL = 2
# Factor of the surrogate's turns for each further answer that did not help, so that an LLM that does not help
# has few of the simulations.
GROWTH = 4.0
# Factor of the surrogate's turns after an answer that helped.
ENCOURAGED = 0.25
# A new best counts if it lowers the best robustness by at least this share; else a half that creeps downwards
# would keep its turns for ever.
NOTABLE = 0.1
# Maximum share of the run's simulations that the surrogate gets before the trial answers, however cheap the
# simulations are: they are what the user limited.
LARGEST_SHARE = 0.1
# Seconds that one US dollar is worth: 36 dollars per hour of waiting.
SECONDS_PER_DOLLAR = 100.0
# Seconds of a question before one was asked.
ASSUMED_QUESTION = 10.0


@dataclass(frozen=True, slots=True)
class Half:
    """What one half has brought so far.

    Attributes:
        turns: number of its turns: simulated candidates of the surrogate, questions to the LLM.
        dry: number of its turns since the last one that helped.
        since: number of its turns since the last one of the other half.
    """

    turns: int = 0
    dry: int = 0
    since: int = 0

    def had_turn(self, *, helped: bool) -> "Half":
        """Return this after one more turn."""
        return Half(self.turns + 1, 0 if helped else self.dry + 1, self.since + 1)

    def yielded(self) -> "Half":
        """Return this after a turn of the other half."""
        return replace(self, since=0)


@dataclass(frozen=True, slots=True)
class Costs:
    """What a turn usually costs, in s; None: unknown.

    Attributes:
        simulation: one simulation.
        proposal: one proposal of the surrogate.
        question: one question to the LLM, with what it cost in money.
    """

    simulation: float | None = None
    proposal: float | None = None
    question: float | None = None

    @property
    def ratio(self) -> float:
        """How many turns of the surrogate cost as much as one of the LLM, at least 1."""
        turn = (self.simulation or 0.0) + (self.proposal or 0.0)
        if turn <= 0.0:
            return 1.0
        question = ASSUMED_QUESTION if self.question is None else self.question
        return 1.0 + max(0.0, question - (self.proposal or 0.0)) / turn


def next_turn(llm: Half, surrogate: Half, costs: Costs, *, simulations: int | None = None) -> Who:
    """Return the half that has the next turn.

    Args:
        llm: what the LLM has brought.
        surrogate: what the surrogate has brought.
        costs: what turns cost.
        simulations: maximum number of simulations of the run; None: no limit.
    """
    waited = surrogate.since if llm.turns < TRIAL else min(surrogate.since, surrogate.dry)
    return "llm" if waited >= _patience(llm, costs, simulations) else "surrogate"


def _patience(llm: Half, costs: Costs, simulations: int | None) -> int:
    """Return the number of the surrogate's turns before the LLM is asked."""
    fair = costs.ratio
    if simulations is not None:
        fair = min(fair, max(1.0, LARGEST_SHARE * simulations))
    if llm.turns == 0:
        return int(fair - 1.0)
    if llm.dry == 0:
        return int(fair * ENCOURAGED)
    return int(fair * GROWTH ** (llm.dry - 1))


def due(*, repeats: bool, promising: bool, trusted: bool, on_trial: bool) -> Due:
    """Return when a candidate of a later answer is simulated.

    Predictions that have not been tested do not tell a right answer from a useless one. On trial, what is new
    is therefore simulated unless predictions are trusted.

    Args:
        repeats: whether it is the same experiment as an earlier sample.
        promising: whether it is predicted to be worth a simulation.
        trusted: whether recent predictions were good.
        on_trial: whether the LLM has had fewer answers than its trial.
    """
    if promising and (trusted or not repeats):
        return "now"
    if repeats:
        return "never"
    if on_trial:
        return "later" if trusted else "now"
    return "never" if trusted else "later"


def helps(robustness: float | None, best: float, *, share: float = NOTABLE) -> bool:
    """Whether a robustness is below the best one so far by a share of that; inf: there is none yet."""
    return robustness is not None and best < float("inf") and best - robustness >= share * abs(best)


class Ledger:
    """What turns cost so far, from times that others measured or recorded; it reads no clock."""

    def __init__(self) -> None:
        self._simulations: list[float] = []
        self._proposals: list[float] = []
        self._questions: list[float] = []
        self._open_question: float | None = None
        self._wanted = 1
        self._was_asked = False

    @property
    def costs(self) -> Costs:
        """Medians: the first simulation also loads the model."""
        return Costs(_median(self._simulations), _median(self._proposals), _median(self._questions))

    def begin(self, wanted: int) -> None:
        """Note that so many candidates are about to be chosen."""
        self._wanted, self._was_asked = wanted, False

    def exchanged(self, exchange: Exchange) -> None:
        """Add an exchange with the LLM to the current question, with the money that it cost."""
        cost = exchange.seconds + SECONDS_PER_DOLLAR * (exchange.usage.cost or 0.0)
        self._open_question = (self._open_question or 0.0) + cost

    def answered(self) -> None:
        """Note that the current question has ended, with an answer or without."""
        self._was_asked = True
        if self._open_question is not None:
            self._questions.append(self._open_question)
        self._open_question = None

    def asked(self, seconds: float) -> None:
        """Note how long it took to choose the candidates; if the LLM was asked, it is not the surrogate's."""
        if not self._was_asked:
            self._proposals.append(seconds / self._wanted)

    def simulated(self, seconds: float) -> None:
        """Add a simulation; an evaluation without a time was not measured."""
        if seconds > 0.0:
            self._simulations.append(seconds)


def _median(seconds: Sequence[float]) -> float | None:
    return median(seconds) if seconds else None
