"""The workers of this process: one per model and thread."""

import atexit
import contextlib
import os
import threading
from collections.abc import Collection, Hashable, Iterable

from falsifier.errors import ModelError
from falsifier.fmu.process import start
from falsifier.fmu.process.order import Order
from falsifier.fmu.process.rights import Policy
from falsifier.fmu.process.runner import Runner
from falsifier.fmu.process.start import Workplace

# A thread simulates with one worker at a time; the others save the start if it returns to their FMUs.
_MOST_OF_A_THREAD = 12


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
            _close(superfluous)
        return found

    def drop(self, key: Hashable) -> None:
        """Close what simulates a model, in all threads."""
        with self._lock:
            found = [self._runners.pop(each) for each in list(self._runners) if each[0] == key]
        for runner in found:
            runner.close()

    def stop(self, threads: Collection[int]) -> None:
        """End the workers of some threads, also in the middle of a simulation."""
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


def _close(runners: Iterable[Runner]) -> None:
    for runner in runners:
        with contextlib.suppress(ModelError):
            runner.close()


REGISTRY = Registry()


def rights_text(allow: Iterable[str] = (), deny: Iterable[str] = ()) -> str:
    """Say in one line what FMUs may do on this machine, and what of that it does not enforce.

    Args:
        allow: what users allow; see Policy.
        deny: what they deny.

    Raises:
        SpecError: if one of these is unknown.
        ModelError: if FMUs cannot be run on this machine.
    """
    return start.rights_text(REGISTRY.workplace(), Policy.of(allow, deny))


def stop_simulations(threads: Collection[int]) -> None:
    """End the workers of threads of this process, also in the middle of a simulation.

    Args:
        threads: their identifiers (threading.get_ident); they start no other simulation.
    """
    REGISTRY.stop(threads)
