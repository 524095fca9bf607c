"""What a worker does before it simulates, however it was started."""

import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path

from falsifier.core import operating_system
from falsifier.errors import FalsifierError
from falsifier.fmu import machine_code
from falsifier.fmu.channel import Reply, send_reply
from falsifier.fmu.library import load_binding
from falsifier.fmu.worker_order import Order

# Share of the machine's memory that one worker may allocate; beyond it, allocations fail inside the FMU.
_MEMORY_SHARE = 0.8
_COMPILING_STEPS = "compiling the loops that step FMUs, once per installation"
_COMPILING_MASTER = "compiling the loop that steps systems of FMUs, once per installation"
_COMPILING_CALLS = "compiling the calls of components in processes of their own, once per installation"
_COMPILING = "compiling the model-exchange solver, once per installation; this takes half a minute or more"


class Loops:
    """The compiled loops that this process has loaded beyond those that every simulation needs."""

    def __init__(self) -> None:
        self._loaded: set[str] = set()

    def load(self, order: Order, tell: Callable[[str], None]) -> None:
        """Load what an order needs, outside any time limit; ``tell`` hears before anything is compiled."""
        if order.through_wine:  # its worker has loops of its own
            return
        members = () if order.network is None else order.network.members
        if order.interface == "model-exchange":
            machine_code.load("model_exchange", lambda: tell(_COMPILING))
        if members:
            from falsifier.fmu import master

            self._once("master", master.warm_up, lambda: tell(_COMPILING_MASTER))
        if any(member.interface == "model-exchange" for member in members):
            from falsifier.fmu import system_solver

            self._once("system solver", system_solver.warm_up, lambda: tell(_COMPILING))
        is_each = order.network is not None and order.network.coupling.isolation == "each"
        if sys.platform == "linux" and is_each:
            from falsifier.fmu import remote_component

            _load(lambda: remote_component.warm_up(members), lambda: tell(_COMPILING_CALLS))

    def _once(self, name: str, warm_up: Callable[[], None], tell: Callable[[], None]) -> None:
        if name not in self._loaded:
            _load(warm_up, tell)
            self._loaded.add(name)


def load_first(tell: Callable[[str], None]) -> None:
    """Load what every simulation needs; ``tell`` hears of a compilation before it starts."""
    load_binding()
    machine_code.load("co_simulation", lambda: tell(_COMPILING_STEPS))


def get_ready(sock: socket.socket) -> bool:
    """Load what every simulation needs; send the parent what happens and the outcome, and return it."""
    try:
        load_first(lambda text: send_reply(sock, Reply(text=text, more=True)))
    except FalsifierError as error:
        send_reply(sock, Reply("unusable", str(error)))
        return False
    send_reply(sock, Reply())
    return True


def _load(warm_up: Callable[[], None], tell: Callable[[], None]) -> None:
    from falsifier.fmu.compiling import on_compilation

    with on_compilation(tell):
        warm_up()


def settle_in(scratch: Path) -> None:
    """Give this process its working folder and its limits; the FMU is loaded after that."""
    operating_system.adopt_orphans()
    os.chdir(scratch)
    operating_system.limit_resources(_MEMORY_SHARE)
    operating_system.flush_lines()
    operating_system.confine()
