"""What a worker does before it simulates, however it was started."""

import os
from collections.abc import Callable
from pathlib import Path

from falsifier.core import operating_system
from falsifier.fmu.worker_order import Order

# Share of the machine's memory that one worker may allocate; beyond it, allocations fail inside the FMU.
_MEMORY_SHARE = 0.8
_COMPILING_MASTER = "compiling the loop that steps systems of FMUs, once per installation"
_COMPILING = "compiling the model-exchange solver, once per installation; this takes about half a minute"


class Loops:
    """The compiled loops that this process has loaded beyond those that every simulation needs."""

    def __init__(self) -> None:
        self._has_solver = self._has_master = False

    def load(self, order: Order, tell: Callable[[str], None]) -> None:
        """Load what an order needs, outside any time limit; ``tell`` hears of long compilations."""
        from falsifier.fmu.compiling import on_long_compilation

        if order.interface == "model-exchange" and not self._has_solver:
            from falsifier.fmu import model_exchange

            with on_long_compilation(lambda: tell(_COMPILING)):
                model_exchange.warm_up()
            self._has_solver = True
        if order.network is not None and not self._has_master:
            from falsifier.fmu import master

            with on_long_compilation(lambda: tell(_COMPILING_MASTER)):
                master.warm_up()
            self._has_master = True


def settle_in(scratch: Path) -> None:
    """Give this process its working folder and its limits; the FMU is loaded after that."""
    operating_system.adopt_orphans()
    os.chdir(scratch)
    operating_system.limit_resources(_MEMORY_SHARE)
    operating_system.flush_lines()
    operating_system.confine()
