"""The rules by which the hybrid engine decides which half has the next turn, and which answers are simulated.

The language model (LLM) answers the first and the third time: two turns on trial. Each turn after that which
does not help multiplies the number of turns that the surrogate gets before the LLM is asked again, and then
these must have brought nothing new either. After an answer that helped, it is asked again at once.
"""

from dataclasses import dataclass, replace
from typing import Literal

Who = Literal["llm", "surrogate"]

# Answers of the LLM, the first of which knows nothing of the system, before it must have helped.
TRIAL = 2
# Factor of the surrogate's turns for each further answer that did not help, so that an LLM that does not help
# has few of the simulations.
GROWTH = 4
# A new best counts if it lowers the best robustness by at least this share; else a half that creeps downwards
# would keep its turns for ever.
NOTABLE = 0.1


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


def next_turn(llm: Half, surrogate: Half) -> Who:
    """Return the half that has the next turn, given what each has brought."""
    waited = surrogate.since if llm.turns < TRIAL else min(surrogate.since, surrogate.dry)
    patience = GROWTH ** (llm.dry - 1) if llm.turns and llm.dry else 0
    return "llm" if waited >= patience else "surrogate"


def is_worth_simulating(*, repeats: bool, promising: bool, trusted: bool, on_trial: bool) -> bool:
    """Whether a candidate of a later answer is simulated.

    Predictions that have not been tested do not tell a right answer from a useless one.

    Args:
        repeats: whether it is the same experiment as an earlier sample.
        promising: whether it is predicted to be worth a simulation.
        trusted: whether recent predictions were good.
        on_trial: whether the LLM has had fewer answers than its trial.
    """
    if repeats:
        return promising and trusted
    return promising or on_trial or not trusted


def helps(robustness: float | None, best: float, *, share: float = NOTABLE) -> bool:
    """Whether a robustness is below the best one so far by a share of that; inf: there is none yet."""
    return robustness is not None and best < float("inf") and best - robustness >= share * abs(best)
