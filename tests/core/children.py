"""Code that runs in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

from tests.patience import HANG


def in_child(code: str, **environment: str) -> str:
    """What a process prints that runs this code."""
    done = subprocess.run(
        [sys.executable, "-c", "import os, signal, time\nfrom falsifier.core import linux, posix\n" + code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
        timeout=HANG,
    )
    return done.stdout


def is_gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True
