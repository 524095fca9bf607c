"""How long tests wait for what must happen: never decided by how fast a machine is."""

import time
from collections.abc import Callable

# Seconds, to end a hang: what is waited for takes a few seconds, or minutes on a machine that is very busy.
HANG = 1800.0


def wait_until(happened: Callable[[], bool], *, every: float = 0.01) -> None:
    """Wait until something has happened.

    Raises:
        AssertionError: when it has not after half an hour.
    """
    deadline = time.monotonic() + HANG
    while not happened():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(every)
