"""Noticing that numba compiles for long, which it does once: later processes load what it kept."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LONG_SECONDS = 1.0


@contextmanager
def on_long_compilation(tell: Callable[[], None], after: float = _LONG_SECONDS) -> Iterator[None]:
    """Call ``tell`` once if numba compiles within the context and is not done after so many seconds.

    What is loaded from numba's cache is not compiled. Functions are compiled one inside the other and one
    after the other; each beginning and each end is an occasion to look at the clock.
    """
    from numba.core import event

    begun: float | None = None
    told = False

    def look() -> None:
        nonlocal begun, told
        now = time.perf_counter()
        begun = now if begun is None else begun
        if not told and now - begun > after:
            told = True
            tell()

    class Watcher(event.Listener):  # type: ignore[misc]
        def on_start(self, _event: object) -> None:
            look()

        def on_end(self, _event: object) -> None:
            look()

    with event.install_listener("numba:compile", Watcher()):
        yield
