"""The environment that FMU processes see: everything but secrets."""

from collections.abc import Mapping

from falsifier.core.secrets import scrubbed


def worker_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Environment of the processes that FMUs run in; one thread each, they run side by side."""
    return {
        **scrubbed(environment),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
    }
