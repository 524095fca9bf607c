"""The environment of the processes that run FMUs: everything except secrets."""

from collections.abc import Mapping

from falsifier.core import operating_system
from falsifier.core.secrets import holds_secrets, scrubbed


def protect_secrets(environment: Mapping[str, str]) -> None:
    """Keep FMUs from reading this process's secrets where they are not confined to their own processes.

    On Linux, any process could otherwise read the environment of another one of the same user. Without
    secrets, or if FMUs can be confined, this process stays open to debuggers.
    """
    if holds_secrets(environment) and not operating_system.can_confine():
        operating_system.hide_memory()


def worker_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a worker: no secrets, and one thread, because workers run in parallel."""
    return {
        **scrubbed(environment),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
    }
