"""The environment of the processes that run FMUs: what a library may need, and no secrets."""

import re
from collections.abc import Mapping
from pathlib import Path

from falsifier.core import operating_system
from falsifier.core.secrets import holds_secrets, scrubbed

# Names of further variables to pass on, separated by commas.
MORE = "FALSIFIER_FMU_VARIABLES"

# Where programs and libraries are, who the user is, language and time zone, what Windows and its C libraries
# need, and licences.
_PASSED = re.compile(
    r"PATH|HOME|USER|LOGNAME|LANG|LANGUAGE|LC_\w+|TZ|LD_LIBRARY_PATH|DYLD_(FALLBACK_)?LIBRARY_PATH"
    r"|SYSTEMROOT|SYSTEMDRIVE|WINDIR|COMSPEC|PATHEXT|PROGRAMDATA|PROGRAMFILES(\(X86\))?|COMMONPROGRAMFILES"
    r"|APPDATA|LOCALAPPDATA|USERPROFILE|USERNAME|COMPUTERNAME|NUMBER_OF_PROCESSORS|PROCESSOR_\w+|OS"
    r"|\w*LICEN[SC]E\w*",
    re.IGNORECASE,
)


def protect_secrets(environment: Mapping[str, str]) -> None:
    """Keep FMUs from reading this process's secrets where they are not confined to their own processes.

    On Linux, any process could otherwise read the environment of another one of the same user. Without
    secrets, or if FMUs can be confined, this process stays open to debuggers.
    """
    if holds_secrets(environment) and not operating_system.can_confine():
        operating_system.hide_memory()


def worker_environment(environment: Mapping[str, str], scratch: Path) -> dict[str, str]:
    """Return the environment of a worker.

    Args:
        environment: that of this process.
        scratch: the worker's folder, where its temporary files go.
    """
    more = {name.strip() for name in environment.get(MORE, "").split(",")}
    passed = {name: value for name, value in environment.items() if _PASSED.fullmatch(name) or name in more}
    folders = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(scratch))
    # One thread each, because workers run in parallel.
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {**scrubbed(passed), **folders, **threads}
