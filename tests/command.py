"""Run the command line as a user does: another process, its exit code and its two streams."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import click

from tests.forking import run
from tests.patience import HANG

ROOT = Path(__file__).resolve().parents[1]


def listen_to_interrupts() -> None:
    """Before a child starts: background jobs and nohup ignore signals, which children inherit."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def commands(group: click.Group, *names: str) -> Iterator[tuple[str, click.Command]]:
    """The commands of the command line, by what a user types for them."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, *names, name)
        else:
            yield " ".join((*names, name)), command


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


def falsifier(
    *arguments: str,
    cwd: Path,
    env: dict[str, str] | None = None,
    fresh: bool = False,
    code: int | None = None,
) -> Done:
    """Run ``falsifier`` with these arguments in a folder, without keys in the environment.

    ``fresh``: start a new interpreter, for tests of what is imported or what variables do to the interpreter.
    ``code``: what it must end with.
    """
    clean = {k: v for k, v in os.environ.items() if not k.endswith(("_API_KEY", "_TOKEN"))}
    environment = clean | {"PYTHONPATH": str(ROOT), "COLUMNS": "160"} | (env or {})
    if fresh:
        ended = subprocess.run(
            [sys.executable, "-c", "from falsifier.cli import main; main()", *arguments],
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
            timeout=HANG,
            check=False,
        )
        done = Done(ended.returncode, ended.stdout, ended.stderr)
    else:
        done = forked(["falsifier", *arguments], cwd, environment)
    assert code in (None, done.code), f"ended with {done.code}: {done.err}{done.out}"
    return done


def forked(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> Done:
    """Run ``falsifier`` or ``pytest`` in a copy of a process that has imported what is slow to import."""
    with NamedTemporaryFile() as out, NamedTemporaryFile() as err:
        code = run(command, folder, environment, (os.devnull, out.name, err.name))
        return Done(code, out.read().decode(), err.read().decode())
