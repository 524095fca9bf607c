"""Detects compilations by numba; they happen once, later processes load the result from the cache."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def on_compilation(tell: Callable[[], None]) -> Iterator[None]:
    """Call ``tell`` once, when numba starts to compile the first function that is not in its cache."""
    from numba.core import event

    told = False

    class Watcher(event.Listener):  # type: ignore[misc]
        def on_start(self, _event: object) -> None:
            nonlocal told
            if not told:
                told = True
                tell()

        def on_end(self, _event: object) -> None:
            pass

    with event.install_listener("numba:compile", Watcher()):
        yield
