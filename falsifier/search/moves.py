"""Which move is next: ask the engine, ask the scout for cheap proposals, or wait for a simulation.

If simulations count, an engine is asked as soon as a core is free, and waits only if none is. If time counts
and a simulation takes less time than a proposal, the scout gets what the engine's thinking leaves unused: on
one core as much time as the engine, on several cores all that do not think.

The rule depends on what was measured, so two runs of the same seed may differ. A run records its moves, and a
resumed run repeats the recorded ones.
"""

from dataclasses import dataclass, replace
from statistics import mean, median
from typing import Literal

# What a run has to keep small.
Objective = Literal["simulations", "time"]
# Who proposes candidates.
Proposer = Literal["engine", "scout"]

# Number of the last proposals and simulations that say what the next ones will take.
_RECENT = 8
# Maximum number of scouts at a time on one core: the next ones learn from these.
_CHUNK = 8
# The same per other core: a wrong estimate must not delay the engine for long.
_MOST_AHEAD = 256


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask a proposer for n candidates, and start to simulate them."""

    proposer: Proposer
    n: int


# None: wait for the oldest simulation that has been started.
Move = Ask | None


@dataclass(frozen=True, slots=True)
class Costs:
    """What the run's simulations and proposals have cost so far, in s.

    Attributes:
        thinking: time in the engine: asking it, and telling it what it asked for.
        scouting: time for the scout's candidates: proposing, simulating and telling.
        scouts: number of the scout's candidates that were simulated.
        proposals: thinking per candidate of the engine's last turns.
        simulations: the last simulations.
    """

    thinking: float = 0.0
    scouting: float = 0.0
    scouts: int = 0
    proposals: tuple[float, ...] = ()
    simulations: tuple[float, ...] = ()

    def asked(self, proposer: Proposer, count: int, seconds: float) -> "Costs":
        """Return this after a proposer has returned so many candidates."""
        if proposer == "scout":
            return replace(self, scouting=self.scouting + seconds)
        proposals = (*self.proposals, seconds / max(1, count))[-_RECENT:]
        return replace(self, thinking=self.thinking + seconds, proposals=proposals)

    def simulated(self, proposer: Proposer, seconds: float) -> "Costs":
        """Return this after a simulation; one without a time was not measured."""
        measured = self.simulations if seconds <= 0.0 else (*self.simulations, seconds)[-_RECENT:]
        if proposer == "engine":
            return replace(self, simulations=measured)
        return replace(self, simulations=measured, scouting=self.scouting + seconds, scouts=self.scouts + 1)

    def told(self, share: float, seconds: float) -> "Costs":
        """Return this after evaluations were told, of which a share in [0, 1] were the scout's."""
        return replace(
            self,
            thinking=self.thinking + (1.0 - share) * seconds,
            scouting=self.scouting + share * seconds,
        )

    @property
    def proposal(self) -> float:
        """What a proposal of the engine costs now; a mean, as an engine's arms take very different times."""
        return mean(self.proposals) if self.proposals else 0.0

    @property
    def simulation(self) -> float:
        """What a simulation costs now; a median, as the first one also loads the model. inf before it."""
        return median(self.simulations) if self.simulations else float("inf")

    @property
    def scout(self) -> float:
        """What a candidate of the scout costs, with all that it causes."""
        return self.scouting / self.scouts if self.scouts else self.simulation


@dataclass(frozen=True, slots=True)
class Situation:
    """What the next move depends on.

    Attributes:
        waiting: number of candidates that are being simulated, or are to be.
        last: who was asked last.
        cores: number of simulations at a time.
        left: number of simulations that the budget still allows to start; None: no limit.
        in_batches: whether the engine is asked for all candidates at once, because each question costs.
        may_scout: whether time counts, and there is a scout.
        costs: what was measured.
    """

    waiting: int
    last: Proposer
    cores: int
    left: int | None
    in_batches: bool
    may_scout: bool
    costs: Costs


def next_move(now: Situation) -> Move:
    """Return the next move."""
    if now.left is not None and now.left <= 0 and now.waiting:
        return None
    if now.may_scout and now.costs.simulation < now.costs.proposal:
        return _scouted(now)
    if now.in_batches:
        return None if now.waiting else Ask("engine", _at_most(now, now.cores))
    return Ask("engine", 1) if now.waiting < now.cores else None


def _scouted(now: Situation) -> Move:
    """The engine thinks about one candidate at a time; what it leaves unused is the scout's."""
    others = now.cores - 1
    if now.waiting:
        # Other cores simulate while the engine thinks; a single one could not, and is better informed later.
        return Ask("engine", 1) if now.last == "scout" and others else None
    costs = now.costs
    owed = others * (costs.thinking + costs.proposal) if others else costs.thinking
    number = int((owed - costs.scouting) / costs.scout)
    if number < 1 or now.left == 1:
        return Ask("engine", 1)
    return Ask("scout", _at_most(now, min(number, others * _MOST_AHEAD or _CHUNK)))


def _at_most(now: Situation, number: int) -> int:
    return number if now.left is None else max(1, min(number, now.left))
