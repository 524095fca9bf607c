"""The process in which one FMU runs: receives requests, simulates, replies.

It is forked from the nursery or is a program of its own (``spawned``), has no secrets in its environment, and
may crash at any time.
"""

import contextlib
import os
import pickle
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path

from falsifier.core import operating_system
from falsifier.errors import FalsifierError, ModelError, SimulationError
from falsifier.fmu.buffers import Room
from falsifier.fmu.channel import (
    QUICK_SECONDS,
    Closed,
    Reply,
    close_all,
    receive_request,
    send_reply,
    watch,
)
from falsifier.fmu.opening import open_session
from falsifier.fmu.plan import Plan
from falsifier.fmu.session import Session
from falsifier.fmu.sharing import attach
from falsifier.fmu.worker_order import Order, Reuse

PREPARE, RUN = 1, 2

# Simulations longer than this are not repeated to test whether a reset reproduces the results.
_MAX_TEST_SECONDS = 1.0
# Some tools' runtimes run out of thread keys after about 1000 instances in one process.
_MAX_INSTANCES = 400
_NO_MEMORY = "not enough memory for the FMU and what surrounds it"
# Growth in memory after which a worker that leaks is replaced.
_MAX_GROWTH_KIB = 256 << 10


def serve(sock: socket.socket, order: Order, folder: Path) -> None:
    """Reply to requests until the connection is closed or the process should be replaced.

    Args:
        sock: connection to the process that requests simulations.
        order: what to simulate; if it does not say how simulations start, this is tested after the first.
        folder: folder to which the FMU was extracted.
    """
    worker = _Worker(order, folder)
    while True:
        try:
            kind, payload, descriptors = receive_request(sock)
        except Closed:
            return
        if kind == PREPARE:
            plan, place = pickle.loads(payload)
            send_reply(sock, worker.prepare(plan, place, descriptors))
            close_all(descriptors)
            continue
        started = time.perf_counter()
        reply = worker.run()
        is_quick = time.perf_counter() - started < QUICK_SECONDS
        send_reply(sock, reply)
        if reply.more:
            reply = worker.find_reuse(lambda reuse: send_reply(sock, Reply(text=reuse, more=True)))
            send_reply(sock, reply)
        if reply.leaving:
            return
        if is_quick:
            watch(sock, QUICK_SECONDS)


class _Worker:
    def __init__(self, order: Order, folder: Path) -> None:
        self._order, self._folder = order, folder
        self._reuse = order.reuse
        self._session: Session | None = None
        self._instances = 0
        self._first_size = 0

    def prepare(self, plan: Plan, place: str, descriptors: list[int]) -> Reply:
        try:
            self._plan, self._room = plan, Room.over(plan, attach(place, descriptors))
            session = self._session or self._load()
            session.prepare(self._plan, self._room)
        except SimulationError as error:
            return Reply("failed", str(error))
        except FalsifierError as error:
            return Reply("unusable", str(error))
        except MemoryError:
            return Reply("unusable", _NO_MEMORY)
        return Reply()

    def _load(self) -> Session:
        """Load the library and make an instance, which may succeed at another time."""
        try:
            self._session = open_session(self._order, self._folder, _log, self._announce)
        except ModelError as error:
            raise SimulationError(str(error)) from error
        return self._session

    def _announce(self, position: int) -> None:
        self._room.component[0] = position

    def run(self) -> Reply:
        assert self._session is not None, "prepare must be called before run"
        self._session.reuse = self._reuse or "instance"
        self._instances += self._session.reuse in ("instance", "library") or not self._instances
        started = time.perf_counter()
        try:
            self._session.run()
        except SimulationError as error:
            at = -1.0 if error.time is None else error.time
            return Reply("timeout" if error.status == "timeout" else "failed", str(error), at)
        except FalsifierError as error:
            return Reply("unusable", str(error))
        except MemoryError:
            return Reply("failed", _NO_MEMORY)
        if self._reuse is None and time.perf_counter() - started > _MAX_TEST_SECONDS:
            self._reuse = "process" if "instance" in self._order.untrusted else "instance"
        return Reply(more=self._reuse is None, leaving=self._reuse is not None and self._is_spent())

    def find_reuse(self, announce: Callable[[Reuse], None]) -> Reply:
        """Repeat the simulation with each kind of reuse; the first with the same outputs is chosen."""
        assert self._session is not None, "run must be called before find_reuse"
        self._reuse = self._session.find_reuse(self._order.untrusted, announce)
        return Reply(text=self._reuse, leaving=self._is_spent())

    def _is_spent(self) -> bool:
        """Whether this process should be replaced: too many instances, or too much memory."""
        if self._instances >= _MAX_INSTANCES or self._reuse == "process":
            return True
        elsewhere = self._session.memory_elsewhere if self._session is not None else 0
        size = operating_system.most_memory_used() + elsewhere
        self._first_size = self._first_size or (size if self._instances else 0)
        return bool(self._first_size) and size > self._first_size + _MAX_GROWTH_KIB


def _log(line: str) -> None:
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), line.encode("utf-8", "replace") + b"\n")
