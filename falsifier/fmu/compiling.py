"""Detects long compilations by numba; they happen once, later processes load the result from the cache."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LONG_SECONDS = 1.0


@contextmanager
def on_long_compilation(tell: Callable[[], None], after: float = _LONG_SECONDS) -> Iterator[None]:
    """Call ``tell`` once if numba is still compiling ``after`` seconds after its first compilation started.

    Loading from numba's cache is not a compilation. Functions are compiled nested and in sequence; the clock
    is checked at the start and the end of each.
    """
    from numba.core import event

    started: float | None = None
    told = False

    def check_clock() -> None:
        nonlocal started, told
        now = time.perf_counter()
        started = now if started is None else started
        if not told and now - started > after:
            told = True
            tell()

    class Watcher(event.Listener):  # type: ignore[misc]
        def on_start(self, _event: object) -> None:
            check_clock()

        def on_end(self, _event: object) -> None:
            check_clock()

    with event.install_listener("numba:compile", Watcher()):
        yield
