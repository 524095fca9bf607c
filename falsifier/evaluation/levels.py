"""The different values of robustness of a search."""

from bisect import bisect_left
from dataclasses import dataclass, field
from math import inf

# Two values of robustness that differ by less than this share of the larger one are the same level.
_SAME = 1e-6
# Robustness is a staircase if it has at most one value per so many simulations, from so many values on.
_PER_LEVEL, _FEWEST = 4, 2


@dataclass(slots=True)
class Level:
    """One value of robustness.

    Attributes:
        robustness: the value.
        first: number of the first simulation that reached it, from 1.
        simulations: number of simulations that had it.
    """

    robustness: float
    first: int
    simulations: int = 1


@dataclass(slots=True)
class Levels:
    """The different values of robustness so far, the lowest first."""

    found: list[Level] = field(default_factory=list)
    simulations: int = 0

    @property
    def lowest(self) -> float:
        """The lowest robustness; inf before the first one."""
        return self.found[0].robustness if self.found else inf

    @property
    def is_plateau(self) -> bool:
        """Whether all of several simulations had the same robustness."""
        return self.simulations >= _PER_LEVEL and len(self.found) == 1

    @property
    def is_staircase(self) -> bool:
        """Whether many simulations had few different values of robustness, which lead down in steps."""
        count = len(self.found)
        return count >= _FEWEST and self.simulations >= _PER_LEVEL * count

    def add(self, robustness: float, number: int | None = None) -> int | None:
        """Add a simulation; return the place of its level if it is a new one.

        Args:
            robustness: its robustness.
            number: its number, from 1; None: that of those added.
        """
        self.simulations += 1
        place = bisect_left(self.found, robustness, key=lambda level: level.robustness)
        for level in self.found[max(0, place - 1) : place + 1]:
            if abs(robustness - level.robustness) <= _SAME * max(abs(level.robustness), abs(robustness)):
                level.simulations += 1
                return None
        self.found.insert(place, Level(robustness, number or self.simulations))
        return place
