"""The workers of this process, one per model and thread; inputs in, a trajectory out."""

import atexit
import contextlib
import os
import threading
import time
from collections.abc import Collection, Hashable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from falsifier.core.experiment import Experiment
from falsifier.core.model import check_finite
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ModelError
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.plan import Plan, given_values, make_plan
from falsifier.fmu.process.rights import Rights, described, read_told, resolved
from falsifier.fmu.process.runner import Runner
from falsifier.fmu.process.start import Started
from falsifier.fmu.process.workplace import Workplace

# A thread simulates with one worker at a time; the others save the start if it returns to their FMUs.
_MOST_OF_A_THREAD = 12
# A worker has told what is enforced after at most the first; it is looked for after the second.
_SETUP_SECONDS, _LOOKING_SECONDS = 10.0, 0.001


class Registry:
    """What simulates in this process, and the folder of its workers; a copy of the process begins anew."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._workplace: Workplace | None = None
        self._runners: dict[tuple[Hashable, int], Runner] = {}
        atexit.register(self.close)
        os.register_at_fork(after_in_child=self.forget)

    def workplace(self) -> Workplace:
        """Return the folder of the workers; make it if necessary."""
        with self._lock:
            if self._workplace is None:
                self._workplace = Workplace()
            return self._workplace

    def runner(self, order: Order) -> Runner:
        """Return what simulates a model in this thread.

        The runners of ended threads are closed, because nobody says when a thread has ended, and the oldest
        of a thread that has many.
        """
        # Not get_ident: threads of other libraries are listed only once they have asked for themselves.
        thread = threading.current_thread().ident or 0
        found = self._runners.get((order.key, thread))
        if found is None:
            with self._lock:
                superfluous = self._take_superfluous(thread)
                found = self._runners[order.key, thread] = Runner(self.workplace, order)
            for runner in superfluous:
                with contextlib.suppress(ModelError):
                    runner.close()
        return found

    def drop(self, key: Hashable) -> None:
        """Close what simulates a model, in all threads."""
        with self._lock:
            found = [self._runners.pop(each) for each in list(self._runners) if each[0] == key]
        for runner in found:
            runner.close()

    def stop(self, threads: Collection[int]) -> None:
        """End the workers of threads (threading.get_ident), which start no other simulation, at once."""
        with self._lock:
            found = [self._runners.pop(each) for each in list(self._runners) if each[1] in threads]
        for runner in found:
            runner.stop()

    def close(self) -> None:
        """End all workers, also in the middle of a simulation, and remove their folder."""
        with self._lock:
            runners, self._runners = self._runners, {}
            workplace, self._workplace = self._workplace, None
        for runner in runners.values():
            with contextlib.suppress(ModelError):
                runner.stop()
        if workplace is not None:
            workplace.remove()

    def forget(self) -> None:
        """Leave all workers to another process, of which this is a copy."""
        self._lock = threading.Lock()
        for runner in self._runners.values():
            runner.forget()
        if self._workplace is not None:
            self._workplace.forget()
        self._runners, self._workplace = {}, None

    def _take_superfluous(self, thread: int) -> list[Runner]:
        alive = {each.ident for each in threading.enumerate()}
        keys = [key for key in self._runners if key[1] not in alive]
        own = [key for key in self._runners if key[1] == thread]
        keys += own[: max(0, len(own) + 1 - _MOST_OF_A_THREAD)]
        return [self._runners.pop(key) for key in keys]


REGISTRY = Registry()
stop_simulations = REGISTRY.stop


def simulate(
    order: Order,
    experiment: Experiment,
    inputs: Mapping[str, NDArray[np.float64]],
    parameters: Mapping[str, float],
) -> Trajectory:
    """Simulate once, in this thread's worker, with inputs as piecewise cubics (``Signal.pieces``).

    Raises:
        SimulationError: if there is no complete trajectory of finite numbers.
        ModelError: if the model cannot be used.
    """
    # Rounded up to a power of two, so that a few plans suffice for any number of control points.
    pieces = 1 << (max(map(len, inputs.values()), default=1) - 1).bit_length()
    plan = _plan(order, experiment, tuple(inputs), tuple(parameters), pieces)
    outputs, log = REGISTRY.runner(order).simulate(plan, given_values(plan, inputs, parameters))
    columns = dict(zip(experiment.outputs, outputs, strict=True))
    if not np.isfinite(outputs).all():
        check_finite(plan.model, plan.times, columns, hint="; omit it if no formula names it")
    return Trajectory(plan.times, columns, plan.units, log)


@lru_cache(maxsize=64)
def _plan(
    order: Order, experiment: Experiment, inputs: tuple[str, ...], parameters: tuple[str, ...], pieces: int
) -> Plan:
    return make_plan(order.network.description, experiment, inputs, parameters, pieces=pieces)


def load(order: Order) -> None:
    """Load an FMU and make an instance in a worker of its own; ModelError if that fails."""
    runner = Runner(REGISTRY.workplace, order)
    try:
        runner.load(make_plan(order.network.description, Experiment(1.0, 1.0, ()), (), ()))
    finally:
        runner.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class Isolated:
    """What models have in common whose FMUs run in processes of their own."""

    has_own_processes: ClassVar[bool] = True
    # Whether to ask the FMUs for messages in every simulation; otherwise only after a failure.
    logging: bool = False
    allow: tuple[str, ...] = ()  # what they may do; see Rights
    deny: tuple[str, ...] = ()  # what they may not do

    @property
    def order(self) -> Order:
        """What workers are asked to simulate."""
        return _order(self)

    def _make_order(self) -> Order:
        """Make what ``order`` keeps."""
        raise NotImplementedError

    @property
    def rights(self) -> Rights:
        """What the FMUs may do."""
        return Rights.of(self.allow, self.deny)

    def close(self) -> None:
        """End the worker processes; the next simulation starts again."""
        REGISTRY.drop(self.order.key)

    def _resolve_rights(self) -> None:
        """Make the paths of what is allowed absolute; SpecError naming what is unknown or absent."""
        for name in ("allow", "deny"):
            object.__setattr__(self, name, resolved(getattr(self, name), Path()))
        _ = self.rights


@lru_cache(maxsize=64)
def _order(model: Isolated) -> Order:
    return model._make_order()


def rights_text(allow: Collection[str] = (), deny: Collection[str] = ()) -> str:
    """Say in one line what FMUs may do on this machine, and what of that it does not enforce.

    It starts a worker to see that.

    Raises:
        SpecError: if one of these is unknown.
        ModelError: if FMUs cannot be run on this machine.
    """
    wanted, workplace = Rights.of(allow, deny), REGISTRY.workplace()
    told, until = b"", time.monotonic() + _SETUP_SECONDS
    started = Started(workplace, workplace.scratch(), wanted, through_wine=False)
    while not told.endswith(b"\0") and started.program.is_alive and time.monotonic() < until:
        told += started.program.told()
        time.sleep(_LOOKING_SECONDS)
    if not told:
        raise started.not_started()
    started.end()
    return described(wanted, read_told(told).enforced)
