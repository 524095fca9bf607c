"""How one simulation is run: its times, outputs and limits."""

from dataclasses import dataclass, field
from fractions import Fraction
from math import ceil, gcd, lcm

import numpy as np
from numpy.typing import NDArray

from falsifier.core.arguments import positive
from falsifier.core.fixed import fixed
from falsifier.core.literals import digits
from falsifier.errors import SpecError

# Relative tolerance for one time to be a multiple of another: rounding leaves no exact multiple of 1/30 s.
GRID_ROUNDING = 1e-6
# Maximum number of steps of each kind per simulation; trajectories have one sample per output interval.
MAX_STEPS = 10_000_000
# Largest denominator of times like 1/30 s, which are written with many digits.
_MAX_DENOMINATOR = 100_000
_ROUNDING = 1e-12


def exact(seconds: float) -> Fraction:
    """Return a time as the fraction that was meant: 0.1 as 1/10, 0.3333333333333333 as 1/3.

    >>> exact(0.1), exact(1 / 30)
    (Fraction(1, 10), Fraction(1, 30))
    """
    written = Fraction(repr(float(seconds)))
    near = written.limit_denominator(_MAX_DENOMINATOR)
    return near if abs(near - written) <= _ROUNDING * abs(written) else written


def common_part(*times: Fraction) -> Fraction:
    """Return the largest time of which all of these are multiples."""
    denominator = lcm(*(t.denominator for t in times))
    return Fraction(gcd(*(int(t * denominator) for t in times)), denominator)


def whole_steps(what: str, whole: float, part: str, period: float, *, key: str = "") -> int:
    """Return how many times a period fits into a time; SpecError, with a round shorter one that does."""
    if not whole / period < MAX_STEPS + 1:
        raise SpecError(
            f"{what} = {whole:.12g} s has more than {MAX_STEPS:,} times {part} = {period:g} s; the smallest "
            f"value is {whole / MAX_STEPS:g}",
            key=key or part,
        )
    count = max(round(whole / period), 1)
    if abs(whole / period - count) > GRID_ROUNDING * count:
        least = ceil(whole / period)
        shorter = (float(f"{whole / n:.12g}") for n in range(least, min(2 * least, least + 1000) + 1))
        raise SpecError(
            f"{what} = {whole:.12g} s is not an integer multiple of {part} = {period:g} s; try {part} = "
            f"{min(shorter, key=digits):.12g}",
            key=key or part,
        )
    return count


@dataclass(frozen=True, slots=True)
class Experiment:
    """How one simulation is run; the same for all candidates of a problem.

    Attributes:
        stop_time: end of the simulation in s; simulations start at 0.
        output_interval: step of the trajectory's time grid in s; the stop time is an integer multiple of it.
        outputs: names of the variables to record.
        step_size: communication step or, in model exchange, longest solver step in s; None: output interval.
        tolerance: relative tolerance passed to the model or used by the solver; None: the model's default.
        time_limit: maximum wall-clock time of one simulation in s; None: as long as it makes progress, see
            ``falsifier.fmu.process.plan``.
        strings: names and values of string parameters.
        internals: internal variables that searches record, too, as engines learn from them where the
            requirement compares nothing but discrete signals.

    Raises:
        SpecError: naming the attribute that is not as above.
    """

    stop_time: float
    output_interval: float
    outputs: tuple[str, ...]
    step_size: float | None = None
    tolerance: float | None = None
    time_limit: float | None = None
    strings: tuple[tuple[str, str], ...] = ()
    internals: tuple[str, ...] = field(default=(), repr=False)  # in no fingerprint: results are the same

    def __post_init__(self) -> None:
        for name in ("stop_time", "output_interval"):
            positive(name, getattr(self, name))
        for name in ("step_size", "tolerance", "time_limit"):
            if (given := getattr(self, name)) is not None:
                positive(name, given)
        if not isinstance(self.outputs, tuple):
            raise SpecError(f"outputs: expected a tuple of names, got {self.outputs!r}")
        whole_steps("stop_time", self.stop_time, "output_interval", self.output_interval)
        if self.step_size is not None:
            whole_steps("output_interval", self.output_interval, "step_size", self.step_size)

    @property
    def step(self) -> float:
        """Communication step or maximum solver step in s."""
        return self.step_size or self.output_interval

    @property
    def samples(self) -> int:
        """Number of samples of the trajectory, including both ends."""
        return round(self.stop_time / self.output_interval) + 1

    @property
    def times(self) -> NDArray[np.float64]:
        """The trajectory's time grid in s, shape (samples,), read-only."""
        return fixed(np.linspace(0.0, self.stop_time, self.samples))
