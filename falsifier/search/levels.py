"""The levels of a search that refines its inputs: what it searches, and from which simulation on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

from falsifier.core.space import SearchSpace
from falsifier.core.words import counted


@dataclass(frozen=True, slots=True)
class Level:
    """One level of a search; a search that does not refine its inputs has one.

    Attributes:
        first: number of simulations before it.
        space: the part of the search space that it searches.
        leaves_finer: whether the budget allowed no level after it, although there are finer inputs.
    """

    first: int
    space: SearchSpace
    leaves_finer: bool = False


def reached(levels: Sequence[Level], simulations: int) -> tuple[Level, ...]:
    """Return the levels that a run of so many simulations has begun; at least the first."""
    return tuple(level for level in levels if level.first < max(simulations, 1))


def level_name(number: int, count: int) -> str:
    """Return what a level is called, given its number from 1."""
    return f"level {number} of {count}"


@dataclass(frozen=True, slots=True)
class LevelResult:
    """What came of one level.

    Attributes:
        name: which level it is.
        simulations: number of its simulations.
        smallest: smallest robustness of these; None if there is none.
        falsified: whether the requirement was falsified on this level.
    """

    name: str
    simulations: int
    smallest: float | None
    falsified: bool

    @property
    def text(self) -> str:
        """The outcome in words."""
        count = counted(self.simulations, "simulation")
        if self.falsified:
            return f"falsified after {count}"
        if not self.simulations:
            return "not begun"
        return f"{count}, " + (
            "all failed" if self.smallest is None else f"smallest robustness {self.smallest:+.6g}"
        )


def level_results(
    starts: Sequence[int], robustness: Sequence[float | None], *, falsified: bool
) -> tuple[LevelResult, ...]:
    """Return what came of each level.

    Args:
        starts: number of simulations before each level.
        robustness: of each simulation of the run, up to the counterexample; None or NaN without a verdict.
        falsified: whether the last of these is a counterexample.
    """
    found = []
    for number, (first, end) in enumerate(zip(starts, (*starts[1:], len(robustness)), strict=True), start=1):
        own = robustness[first:end]
        judged = [value for value in own if value is not None and not isnan(value)]
        is_last = bool(len(own)) and first + len(own) == len(robustness)
        name = level_name(number, len(starts))
        found.append(LevelResult(name, len(own), min(judged, default=None), falsified and is_last))
    return tuple(found)
