"""One worker, as the process that requests simulations sees it, and how it can start again."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, get_args

from falsifier.core.posix import exit_text
from falsifier.errors import ModelError
from falsifier.fmu.description import HOW_TO_INSTALL
from falsifier.fmu.process.connection import (
    QUICK_SECONDS,
    Closed,
    Garbled,
    Reply,
    Request,
    Where,
    receive,
    send,
)
from falsifier.fmu.process.encoding import integers, reals, text
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.patience import SHARES, Patience
from falsifier.fmu.process.plan import Plan
from falsifier.fmu.process.rights import Told, read_told
from falsifier.fmu.process.shared import Room
from falsifier.fmu.process.start import Started, Workplace, crash_code

# A process that could not send its reply ends with this code (main.c); one that is going to end does so soon.
_CUT_OFF, _ENDING_SECONDS = 74, 0.2
# Wine on a busy machine.
_STARTING_SECONDS = 120.0

# How a simulation starts, the cheapest first: with the same instance after a reset or from its saved state,
# with a new instance, with the library loaded again, or in a new process.
Reuse = Literal["reset", "state", "instance", "library", "process"]
REUSES: tuple[Reuse, ...] = get_args(Reuse)

# Failures of simulations in new processes that are repeated to hear the FMU's messages; more say the same.
_MAX_REPEATS = 3
# Longest wait for a trial of a way to start, in s and as a multiple of the first simulation's duration: one
# trial makes an instance and two simulations, on a machine that may be busy.
_LEAST_SECONDS, _DURATIONS = 1.0, 20.0


class Worker:
    """One worker: its process, its memory, and its messages.

    Args:
        workplace: the folder of all workers.
        order: what it simulates.
        reuse: how the next simulation starts; None: it finds out after the first.
        untrusted: ways to start that it does not try.
        logging: whether to ask the FMU for messages.
        time_limit: longest time in s that loading may take.

    Attributes:
        plan: the plan for which it is prepared.
        room: the plan's arrays.
        logging: as above.
        awaits_test: whether it is finding out how simulations can start.
        simulations: number of simulations that it has completed.
        started: when it was started, by time.perf_counter().

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
        folder = workplace.unpacked(order.archives)
        known = len(REUSES) if reuse is None else REUSES.index(reuse)
        self._ways = integers(known, sum(1 << REUSES.index(way) for way in untrusted))
        self._load = order.load(folder, logging=logging)
        self._started = Started(workplace, folder, order.policy, through_wine=order.through_wine)
        self._crash: int | None = None
        self.plan: Plan | None = None
        self.logging = logging
        self.awaits_test = False
        self.simulations = 0
        self.started = time.perf_counter()
        self._is_quick = False
        self._is_loaded = False

    @property
    def pid(self) -> int:
        """Process id."""
        return self._started.program.pid

    def load(self, limit: float) -> Reply:
        """Connect and load the library; the limit is in s.

        Raises:
            Closed: if the process ends.
            TimeoutError: if it takes longer.
        """
        program = self._started.program
        try:
            send(program, Request.CONNECT, self._started.connect)
            self.receive(_STARTING_SECONDS)
        except (Closed, TimeoutError) as error:
            raise ModelError(self._no_start()) from error
        send(program, self._order.kind, self._ways + self._load)
        reply = self.receive(limit)
        self._is_loaded = reply.is_done
        return reply

    def prepare(self, plan: Plan, limit: float) -> Reply:
        """Let the worker look up a plan's variables; errors as for ``load``."""
        started = self._started
        started.memory.fit(Room.size(plan))
        started.memory.give()
        self.room = Room.over(plan, started.memory.values)
        send(started.program, Request.PREPARE, text(started.place) + self._order.prepare(plan))
        reply = self.receive(limit)
        if reply.is_done:
            self.plan, self._check = plan, self._order.checks(plan)
        return reply

    def start(self, fill: Callable[[Room], None]) -> None:
        """Start a simulation.

        Raises:
            SimulationError: if an input does not fit its variable.
            Closed: if the process has ended.
        """
        assert self.plan is not None, "it is prepared"
        fill(self.room)
        self._check(self.room)
        self._started.memory.give()
        payload = reals(self.plan.time_limit) + integers(0 if self.plan.has_limit else SHARES)
        send(self._started.program, Request.SIMULATE, payload)

    def wait(self) -> Reply:
        """Return the outcome of the simulation under way.

        Raises:
            TimeoutError: if there is none in time.
            Closed: if the process has ended.
        """
        assert self.plan is not None, "it is prepared"
        started = time.perf_counter()
        patience = Patience(self._order.name, self.plan)
        polling = QUICK_SECONDS if self._is_quick else 0.0
        while True:
            try:
                reply = self.receive(patience.seconds, polling)
                break
            except TimeoutError:
                patience.look(self.reached)
        self._is_quick = time.perf_counter() - started < QUICK_SECONDS
        if reply.is_done:
            self._started.memory.take()
            self.simulations += 1
            self.awaits_test = reply.more
        return reply

    def receive(self, limit: float, polling: float = 0.0) -> Reply:
        """Wait for a reply; see ``connection.receive``."""
        reply = receive(self._started.program, limit, polling=polling)
        if reply.where == Where.CRASHED:
            self._crash = crash_code(reply.status)
            raise Closed
        return reply if reply.is_done else replace(reply, component=self.position)

    @property
    def reached(self) -> float:
        """Simulated time in s, as the worker says."""
        return self._started.memory.simulated

    @property
    def position(self) -> int:
        """Position of the component of a system that runs or has failed; -1 if the worker tells nonsense."""
        position = self._started.memory.component
        return int(position) if 0 <= position < 1e9 else -1

    @property
    def during(self) -> str:
        """Which component of a system was running, in words; nothing for a single FMU."""
        name = self._order.component(self.position)
        return f" in component {name}" if name else ""

    def take_log(self, reply: Reply | None = None) -> tuple[str, ...]:
        """Return the lines that the FMU has written since the last call, before this reply.

        Only the end of long output is kept.
        """
        return self._started.output.take(None if reply is None else reply.printed)

    def crash(self, error: Exception) -> tuple[str, tuple[str, ...]]:
        """End the process; return in words why it did not go on, and what it wrote."""
        during, program = self.during, self._started.program
        is_cut = not isinstance(error, Garbled) and not program.ends_within(_ENDING_SECONDS)
        log, told = self.take_log(), self._told()
        code = self.end()
        end = f"; {told.refusals}" if told.refusals else ""
        if told.cause:
            return f"{told.cause}{during}{end}", log
        if isinstance(error, Garbled):
            return f"the FMU disturbed the replies of its process{during}{end}", log
        if is_cut or code == _CUT_OFF:
            return f"the FMU cut the connection of its process{during}{end}", log
        return f"the FMU's process crashed{during}: {exit_text(code)}{end}", log

    @property
    def refusals(self) -> str:
        """What the FMU tried since the last call and was refused, for the end of a message."""
        said = self._told().refusals
        return f"; {said}" if said else ""

    def stop(self) -> None:
        """Kill the process while another thread waits for it."""
        self._started.program.stop()

    def end(self) -> int:
        """End the process; return its exit code, negative for a signal."""
        code = self._started.end()
        return code if self._crash is None else self._crash

    def forget(self) -> None:
        """Leave the process to another one, of which this is a copy."""
        with contextlib.suppress(OSError):
            self._started.forget()

    def _told(self) -> Told:
        """Return what the guard has told since the last call."""
        parts = self._started.program.told().split(b"\0")
        # Wine's processes signal each other, in ways that are not needed here.
        kept = [part for part in parts if not (self._order.through_wine and part[:1] == b"s")]
        return read_told(b"\0".join(kept))

    def _no_start(self) -> str:
        code = self.end()
        hint = f"; a Wine for 64-bit programs is needed: {HOW_TO_INSTALL}" if self._order.through_wine else ""
        return f"the program that runs FMUs does not start ({exit_text(code)}){hint}"


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
