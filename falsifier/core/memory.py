"""How much memory this machine grants a process."""

from falsifier.core import operating_system
from falsifier.errors import MachineError

# Below these, libraries of linear algebra end the process, with exit code 1, or wait for ever.
_LEAST = {"d": 300 << 20, "v": 500 << 20}


def check_memory_limits() -> None:
    """Check that a process may use as much memory as its libraries need.

    Raises:
        MachineError: if it may not; names the limit and how to raise it.
    """
    for option, allowed in operating_system.memory_limits().items():
        least = _LEAST[option]
        if allowed < least:
            raise MachineError(
                f"processes may use {allowed >> 20} MiB of memory (ulimit -{option}); simulations need at "
                f"least {least >> 20} MiB: raise it with ulimit -{option} {least >> 10}"
            )
