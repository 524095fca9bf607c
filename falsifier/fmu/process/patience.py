"""How long a simulation may take, and what is told of one that takes long."""

import logging
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from falsifier.fmu.process.plan import Plan

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
GRACE_SECONDS = 0.1
# Without a limit of the user, each of so many shares of the simulated time may take as long as the default.
SHARES = 10
# How often to look how far a simulation is; from when on that is told.
_LOOKING_SECONDS, _LONG_SECONDS = 1.0, 3.0
# Simulations that take longer are told once.
_SLOW_SECONDS = 10.0

# Hears the name of a model, the simulated time and the stop time in s.
Listener = Callable[[str, float, float], None]

_LOG = logging.getLogger(__name__)
_LISTENERS: list[Listener] = []
_TOLD: set[str] = set()


@contextmanager
def watching(listener: Listener) -> Iterator[None]:
    """Let a listener hear every second how far simulations are that take long, in whatever thread."""
    _LISTENERS.append(listener)
    try:
        yield
    finally:
        _LISTENERS.remove(listener)


class Patience:
    """How long to wait for one simulation.

    Args:
        name: name of the model.
        plan: what it simulates.
    """

    def __init__(self, name: str, plan: Plan) -> None:
        self._name, self._plan = name, plan
        self._started = time.monotonic()
        self._limit = plan.time_limit + GRACE_SECONDS
        self._deadline = self._started + self._limit
        self._shares = 0 if plan.has_limit else SHARES
        self._next = plan.stop_time / SHARES

    @property
    def seconds(self) -> float:
        """How long to wait before the next look."""
        return min(_LOOKING_SECONDS, max(0.0, self._deadline - time.monotonic()))

    def look(self, reached: float) -> None:
        """Take note of the simulated time in s, which the worker tells: it may be any number.

        Raises:
            TimeoutError: if the simulation takes too long.
        """
        now = time.monotonic()
        if self._shares and reached >= self._next:
            self._shares -= 1
            self._deadline = now + self._limit
            self._next = reached + self._plan.stop_time / SHARES
        if now >= self._deadline:
            raise TimeoutError
        if now - self._started > _LONG_SECONDS and math.isfinite(reached):
            for listener in _LISTENERS:
                listener(self._name, min(max(reached, 0.0), self._plan.stop_time), self._plan.stop_time)


def took(name: str, plan: Plan, seconds: float) -> None:
    """Tell once that simulations of a model take long."""
    if seconds > _SLOW_SECONDS and name not in _TOLD:
        _TOLD.add(name)
        _LOG.warning("%s: a simulation of %g s takes %.0f s", name, plan.stop_time, seconds)
