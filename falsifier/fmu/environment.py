"""The environment that FMU processes see: everything but secrets."""

import re
from collections.abc import Mapping

# Licence servers and run-time folders of exporting tools must stay, so names are judged one by one.
_SECRET_NAME = re.compile(
    r"KEY|TOKEN|SECRET|PASSW|PASSPHRASE|_PWD$|CREDENTIAL|AUTH|COOKIE|PRIVATE|BEARER"
    r"|^(AWS|AZURE|GOOGLE|OPENAI|ANTHROPIC|MISTRAL|GEMINI|COHERE|HF|GITHUB|GITLAB|VAULT|LITELLM|DATABASE)_",
    re.IGNORECASE,
)
# user:password@ in an address, and the shapes of well-known keys.
_SECRET_VALUE = re.compile(
    r"://[^/\s@]+@|(^|[^a-z])(sk|pk|rk)-[\w-]{16,}|gh[opsur]_\w{16,}|xox[abprs]-|AKIA[0-9A-Z]{12,}"
    r"|AIza[\w-]{20,}|-----BEGIN|eyJ[\w-]{10,}\.[\w-]{10,}"
)


def scrubbed(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without variables whose name or value looks like a secret."""
    return {
        name: value
        for name, value in environment.items()
        if not _SECRET_NAME.search(name) and not _SECRET_VALUE.search(value)
    }


def worker_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Environment of the processes that FMUs run in; one thread each, they run side by side."""
    return {
        **scrubbed(environment),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
    }
