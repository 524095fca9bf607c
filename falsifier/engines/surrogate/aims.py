"""How often the levels that context files give are tried: seldom at first, then as often as it pays."""

from dataclasses import dataclass, field

from falsifier.engines.surrogate.settings import Settings


@dataclass(slots=True)
class _Record:
    """Number of simulations, and of those that brought something new."""

    tries: int = 0
    hits: int = 0

    @property
    def rate(self) -> float:
        return (self.hits + 1) / (self.tries + 2)


@dataclass(slots=True)
class Aims:
    """Compares simulations that aimed at levels with all others.

    Attributes:
        settings: shares, and when to give up.
    """

    settings: Settings
    _aimed: _Record = field(default_factory=_Record)
    _other: _Record = field(default_factory=_Record)

    @property
    def share(self) -> float:
        """Return the share of proposals that should aim; 0 if aiming has brought nothing."""
        if self._aimed.tries >= self.settings.aim_trial and not self._aimed.hits:
            return 0.0
        wanted = self.settings.aim_share * self._aimed.rate / self._other.rate
        return min(max(wanted, self.settings.aim_share / 2), self.settings.most_aimed)

    def learn(self, *, aimed: bool, is_new: bool) -> None:
        """Add a simulation.

        Args:
            aimed: whether it aimed at levels.
            is_new: whether its robustness was the lowest so far, or a discrete output did something new.
        """
        record = self._aimed if aimed else self._other
        record.tries += 1
        record.hits += is_new
