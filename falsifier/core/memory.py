"""How much memory this machine grants a process."""

import sys

from falsifier.errors import MachineError

# Below these, libraries of linear algebra end the process, with exit code 1, or wait for ever.
_LEAST = {"d": ("RLIMIT_DATA", 300 << 20), "v": ("RLIMIT_AS", 500 << 20)}


def check_memory_limits() -> None:
    """Check that a process may use as much memory as its libraries need.

    Raises:
        MachineError: if it may not; names the limit and how to raise it.
    """
    if sys.platform == "win32":  # has no such limits
        return
    import resource

    for option, (limit, least) in _LEAST.items():
        allowed = resource.getrlimit(getattr(resource, limit))[0]
        if allowed != resource.RLIM_INFINITY and allowed < least:
            raise MachineError(
                f"processes may use {allowed >> 20} MiB of memory (ulimit -{option}); simulations need at "
                f"least {least >> 20} MiB: raise it with ulimit -{option} {least >> 10}"
            )
