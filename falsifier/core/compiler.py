"""The C compiler of this machine, if it has one."""

import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from falsifier.core.words import counted
from falsifier.errors import ModelError

_COMPILERS = ("cc", "gcc", "clang")
# Generated code of large models can take many minutes to compile.
_TIME_LIMIT_SECONDS = 1800
_SHOWN_ERRORS = 5
_ERROR = re.compile(r"\berror:|undefined (reference|symbol)", re.IGNORECASE)


def compiler() -> list[str]:
    """Return the command of a C compiler; ModelError if there is none."""
    for name in _COMPILERS:
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    raise ModelError(
        "no C compiler found (looked for cc, gcc, clang and the ziglang package); install one, for example "
        "with `pip install ziglang`"
    )


def compile_c(what: Path, folder: Path, arguments: Sequence[str]) -> None:
    """Compile C files into a folder; ModelError, naming what that is, if there is no compiler or it fails."""
    command = [*compiler(), *arguments]
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            encoding="utf-8",
            errors="replace",  # it repeats lines of sources, in whatever encoding they are
            timeout=_TIME_LIMIT_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelError(f"{what}: the compiler did not finish ({error})") from error
    if done.returncode:
        raise ModelError(f"{what}: the sources do not compile with {command[0]}: {_summary(done.stderr)}")


def _summary(said: str) -> str:
    """Return the compiler's errors in short: generated code repeats the same one hundreds of times."""
    lines = said.strip().splitlines()
    errors = [line.strip() for line in lines if _ERROR.search(line)]
    shown = list(dict.fromkeys(errors))[:_SHOWN_ERRORS] or lines[-_SHOWN_ERRORS:]
    count = f"{counted(len(errors), 'error')}, the first:" if len(errors) > len(shown) else ""
    return "\n  ".join([count, *shown])
