"""How the next simulation of an FMU can start, and which of these ways are known to work."""

from typing import Literal, get_args

# The cheapest first: with the same instance after a reset or from its saved state, with a new instance, with
# the library loaded again, or in a new process.
Reuse = Literal["reset", "state", "instance", "library", "process"]
REUSES: tuple[Reuse, ...] = get_args(Reuse)

# Failures of simulations in new processes that are repeated to hear the FMU's messages; more say the same.
_MAX_REPEATS = 3
# Longest wait for a trial of a way to start, in s and as a multiple of the first simulation's duration: one
# trial makes an instance and two simulations, on a machine that may be busy.
_LEAST_SECONDS, _DURATIONS = 1.0, 20.0


class Experience:
    """What is known of one FMU, whichever process it runs in.

    Attributes:
        reuse: how the next simulation starts; None until that was tested.
        untrusted: ways that made the FMU crash or hang.
        trying: the way that is being tested.
    """

    def __init__(self) -> None:
        self.reuse: Reuse | None = None
        self.untrusted: tuple[Reuse, ...] = ()
        self.trying: Reuse = "reset"
        self._repeats = 0
        self._seconds = 0.0

    def took(self, seconds: float) -> None:
        """Remember how long loading the FMU and its first simulation took."""
        self._seconds = max(self._seconds, seconds)

    @property
    def patience(self) -> float:
        """How long to wait for a trial, in s."""
        return _LEAST_SECONDS + _DURATIONS * self._seconds

    def distrust(self, reuse: Reuse) -> None:
        """Never start in this way again, nor in a cheaper one; test the others."""
        self.untrusted = REUSES[: REUSES.index(reuse) + 1]
        self.reuse = "process" if reuse == "process" else None

    def is_worth_repeating(self) -> bool:
        """Whether to repeat a failure in a new process for its messages; counts the repetitions."""
        self._repeats += 1
        return self._repeats <= _MAX_REPEATS
