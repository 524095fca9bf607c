"""Run the command line as a user does: another process, its exit code and its two streams."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.patience import HANG

ROOT = Path(__file__).resolve().parents[1]


def listen_to_interrupts() -> None:
    """Before a child starts: shells let background jobs ignore Ctrl-C, and children inherit that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@dataclass(frozen=True)
class Done:
    """A finished command."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        loaded: dict[str, Any] = json.loads(self.out)
        return loaded


def falsifier(*arguments: str, cwd: Path, env: dict[str, str] | None = None) -> Done:
    """Run ``falsifier`` with these arguments in a folder, without keys in the environment."""
    clean = {k: v for k, v in os.environ.items() if not k.endswith(("_API_KEY", "_TOKEN"))}
    done = subprocess.run(
        [sys.executable, "-c", "from falsifier.cli import main; main()", *arguments],
        cwd=cwd,
        env=clean | {"PYTHONPATH": str(ROOT), "COLUMNS": "160"} | (env or {}),
        capture_output=True,
        text=True,
        timeout=HANG,
        check=False,
    )
    return Done(done.returncode, done.stdout, done.stderr)
