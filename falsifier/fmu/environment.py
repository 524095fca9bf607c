"""The environment of the processes that run FMUs: everything except secrets."""

from collections.abc import Mapping

from falsifier.core.secrets import scrubbed


def worker_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a worker: no secrets, and one thread, because workers run in parallel."""
    return {
        **scrubbed(environment),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
    }
