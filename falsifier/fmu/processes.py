"""One worker process, as the process that requests simulations sees it."""

import contextlib
import pickle
import socket
import time

import numpy as np

from falsifier.core import operating_system
from falsifier.errors import ModelError
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import QUICK_SECONDS, Reply, receive_reply, send_request, watch
from falsifier.fmu.plan import Plan
from falsifier.fmu.starting import Starter
from falsifier.fmu.worker import PREPARE
from falsifier.fmu.worker_order import Order

# The worker checks the time limit itself; if it has not replied this long after it, it hangs and is killed.
GRACE_SECONDS = 0.1


class WorkerProcess:
    """One worker process, the memory shared with it, and its messages."""

    def __init__(self, owner: Starter, order: Order) -> None:
        self._owner = owner
        started = owner.start(order)
        self.pid, self.sock, self._output = started.pid, started.sock, started.output
        self._life = operating_system.open_life(self.pid)
        self.plan: Plan | None = None
        self.room = Room(np.empty(0), np.empty((0, 0)), np.empty((0, 0)), np.zeros(1))
        self.awaits_test = False
        self.is_quick = False
        self.logging = order.logging
        self.simulations = 0
        self.started = time.perf_counter()

    def prepare(self, plan: Plan) -> Reply:
        """Share memory for a plan with the worker, which then looks up the plan's variables."""
        shared = self._owner.share(max(Room.size(plan) * 8, 8))
        try:
            self.room = Room.over(plan, shared.values)
            send_request(self.sock, PREPARE, pickle.dumps((plan, shared.place)), shared.descriptors)
            reply = self.receive(plan.time_limit + GRACE_SECONDS)
        finally:
            shared.close()
        self.plan = plan if reply.status == "ok" else None
        return reply

    def wait(self, limit: float) -> Reply:
        """Return the outcome of the simulation under way, waiting at most ``limit`` seconds.

        Raises:
            TimeoutError: if there is none by then.
            Closed: if the process has died.
        """
        started = time.perf_counter()
        if self.is_quick:
            watch(self.sock, QUICK_SECONDS)
        reply = self.receive(limit)
        self.is_quick = time.perf_counter() - started < QUICK_SECONDS
        return reply

    def receive(self, limit: float) -> Reply:
        """Wait for a reply; see receive_reply."""
        return receive_reply(self.sock, limit, self._life)

    def take_log(self) -> tuple[str, ...]:
        """Return the lines that the FMU has written since the last call; only the end of long output."""
        return self._output.take()

    def hang_up(self) -> None:
        """End the connection: whichever thread waits for a reply finds it closed."""
        with contextlib.suppress(OSError):
            self.sock.shutdown(socket.SHUT_RDWR)

    def kill(self) -> int:
        """End the process; return its exit code, negative for a signal."""
        try:
            return self._owner.end(self.pid)
        except ModelError:
            # The nursery has ended, so the exit code is unknown; the next worker comes from a new nursery.
            return 0
        finally:
            self.sock.close()
            self._output.close()
            if self._life is not None:
                operating_system.close_life(self._life)
                self._life = None
