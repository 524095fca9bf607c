"""One worker, as the process that requests simulations sees it, and how long it waits for one."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from falsifier.core.posix import exit_text
from falsifier.fmu.process.connection import QUICK_SECONDS, Garbled, Reply, Request, Where, receive, send
from falsifier.fmu.process.encoding import integers, reals, text
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.plan import HEADER, SHARES, Plan
from falsifier.fmu.process.rights import Told, read_told
from falsifier.fmu.process.start import COMPLETE, RUNNING, SIMULATED, Started
from falsifier.fmu.process.workplace import Workplace

# A process that could not send its reply ends with this code (main.c); one that is going to end does so soon.
_CUT_OFF, _ENDING_SECONDS = 74, 0.2
# Wine on a busy machine.
_STARTING_SECONDS = 120.0

# How a simulation starts, the cheapest first: with the same instance after a reset or from its saved state,
# with a new instance, with the library loaded again, or in a new process.
Reuse = Literal["reset", "state", "instance", "library", "process"]
REUSES: tuple[Reuse, ...] = get_args(Reuse)

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
GRACE_SECONDS = 0.1
# How often to look how far a simulation is; from when on that is told.
_LOOKING_SECONDS, _LONG_SECONDS = 1.0, 3.0

# Hears the name of a model, the simulated time and the stop time in s.
Listener = Callable[[str, float, float], None]

_LISTENERS: list[Listener] = []


@contextmanager
def watching(listener: Listener) -> Iterator[None]:
    """Let a listener hear every second how far simulations are that take long, in whatever thread."""
    _LISTENERS.append(listener)
    try:
        yield
    finally:
        _LISTENERS.remove(listener)


class Patience:
    """How long to wait for one simulation."""

    def __init__(self, plan: Plan) -> None:
        self._model = plan.model
        self._started = time.monotonic()
        self._limit = plan.time_limit + GRACE_SECONDS
        self._deadline = self._started + self._limit
        self._stop_time, self._shares = plan.experiment.stop_time, plan.shares
        self._next = self._stop_time / SHARES

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
            self._next = reached + self._stop_time / SHARES
        if now >= self._deadline:
            raise TimeoutError
        if now - self._started > _LONG_SECONDS and math.isfinite(reached):
            for listener in _LISTENERS:
                listener(self._model, min(max(reached, 0.0), self._stop_time), self._stop_time)


class Worker(Started):
    """One worker: its process, its memory, and its messages.

    Simulations after the first start by ``reuse``; without one, it finds out how, but tries no untrusted way.

    Raises:
        ModelError: if it cannot be started.
    """

    def __init__(
        self,
        workplace: Workplace,
        order: Order,
        reuse: Reuse | None,
        untrusted: tuple[Reuse, ...],
        *,
        logging: bool,
    ) -> None:
        self._order = order
        folder = workplace.unpacked([(m.path, m.sha256) for m in order.network.members])
        known = len(REUSES) if reuse is None else REUSES.index(reuse)
        ways = integers(known, sum(1 << REUSES.index(way) for way in untrusted))
        self._load = ways + order.load(folder, logging=logging)
        super().__init__(workplace, folder, order.rights, through_wine=order.through_wine)
        self.plan: Plan | None = None  # for which it is prepared; None: it has not loaded the FMU
        self.logging = logging  # whether it asks the FMU for messages
        self.awaits_test = False  # whether it is finding out how simulations can start
        self.simulations = 0  # that it has completed
        self.is_cut = False  # whether the FMU has disturbed or cut the connection
        self.started = time.perf_counter()
        self._is_quick = False

    def load(self, limit: float) -> Reply:
        """Connect and load the library; the limit is in s.

        Raises:
            ModelError: if the program does not start.
            ConnectionError: if the process ends.
            TimeoutError: if it takes longer.
        """
        try:
            send(self.program, Request.CONNECT, text(self.connect))
            self.receive(_STARTING_SECONDS)
        except (ConnectionError, TimeoutError) as error:
            raise self.not_started() from error
        # The worker tells there which component it loads.
        self.memory.fit(HEADER)
        send(self.program, Request.LOAD, self._load)
        return self.receive(limit)

    def prepare(self, plan: Plan, limit: float) -> Reply:
        """Let the worker look up a plan's variables; errors as for ``load``."""
        self.memory.fit(HEADER + plan.given + len(plan.experiment.outputs) * plan.experiment.samples)
        send(self.program, Request.PREPARE, text(self.place) + self._order.prepare(plan))
        reply = self.receive(limit)
        if reply.is_done:
            self.plan = plan
        return reply

    def simulate(self, plan: Plan, given: NDArray[np.float64]) -> Reply:
        """Simulate once with these numbers; errors as for ``load``."""
        self.memory.write(given, HEADER)
        self.memory.write(np.zeros(1), COMPLETE)
        send(self.program, Request.SIMULATE, reals(plan.time_limit) + integers(plan.shares))
        started = time.perf_counter()
        patience = Patience(plan)
        polling = QUICK_SECONDS if self._is_quick else 0.0
        while True:
            try:
                reply = self.receive(patience.seconds, polling)
                break
            except TimeoutError:
                patience.look(self.reached)
        self._is_quick = time.perf_counter() - started < QUICK_SECONDS
        if reply.is_done:
            self.simulations += 1
            self.awaits_test = reply.more
        return reply

    def outputs(self, plan: Plan) -> NDArray[np.float64]:
        """Return what the last simulation has recorded, shape (outputs, samples)."""
        outputs, samples = len(plan.experiment.outputs), plan.experiment.samples
        found = np.empty(outputs * samples)
        self.memory.read(found, HEADER + plan.given)
        return found.reshape(outputs, samples)

    def receive(self, limit: float, polling: float = 0.0) -> Reply:
        """Wait for a reply; see ``connection.receive``."""
        reply = receive(self.program, limit, polling=polling)
        if reply.where == Where.CRASHED:
            self.exception = reply.status
            raise ConnectionError("the program tells a crash")
        return reply if reply.is_done else replace(reply, component=self._position)

    @property
    def reached(self) -> float:
        """Simulated time in s, as the worker says."""
        return self.memory.header(SIMULATED)

    @property
    def is_complete(self) -> bool:
        """Whether the worker says that the last simulation has reached its end, and recorded all outputs."""
        return self.plan is not None and self.memory.header(COMPLETE) == self.plan.experiment.stop_time

    @property
    def _position(self) -> int:
        """Position of the component of a system that runs or has failed; -1 if the worker tells nonsense."""
        position = self.memory.header(RUNNING)
        return int(position) if 0 <= position < 1e9 else -1

    @property
    def during(self) -> str:
        """Which component of a system was running, in words; nothing for a single FMU."""
        name = self._order.network.stepped(self._position)
        return f" in component {name}" if name else ""

    def crash(self, error: Exception) -> tuple[str, str, tuple[str, ...]]:
        """End the process; return in words what happened, details to be told after it, and what it wrote."""
        during, is_garbled = self.during, isinstance(error, Garbled)
        is_open = not is_garbled and not self.program.ends_within(_ENDING_SECONDS)
        log, told = self.output.take(), self._told()
        code = self.end()
        self.is_cut = is_garbled or is_open or code == _CUT_OFF
        what, details = told.cause, f"; {told.refusals}" if told.refusals else ""
        if not what and self.is_cut:
            what = f"the FMU {'disturbed the replies' if is_garbled else 'cut the connection'} of its process"
        elif not what:
            what, details = "the FMU's process crashed", f": {exit_text(code)}{details}"
        return what + during, details, log

    @property
    def refusals(self) -> str:
        """What the FMU tried since the last call and was refused, for the end of a message."""
        said = self._told().refusals
        return f"; {said}" if said else ""

    def _told(self) -> Told:
        """Return what the guard has told since the last call."""
        parts = self.program.told().split(b"\0")
        # Wine's processes signal each other, in ways that are not needed here.
        kept = [part for part in parts if not (self._order.through_wine and part[:1] == b"s")]
        return read_told(b"\0".join(kept))
