"""A process that has imported what is slow to import, and forks a copy of itself for each command.

Most of the time that a command takes is spent on imports. The copy is a process like any other, with an
environment, a folder, standard streams and an exit code of its own. All processes of a session share it.
"""

import atexit
import gc
import importlib
import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from pkgutil import walk_packages
from typing import NoReturn, TextIO

from tests.patience import HANG

# Imported by commands when they need them.
_SLOW = (
    "hypothesis",
    "matplotlib.backends.backend_agg",
    "matplotlib.figure",
    "matplotlib.font_manager",
    "pytest",
    "rtamt",
    "scipy.interpolate",
    "scipy.optimize",
    "scipy.stats",
)
# Packages of which commands import many modules one by one.
_LARGE = ("falsifier", "openai.resources")
# What runs when it is imported.
_NEVER = ("falsifier.__main__",)
# Where the server of another process listens.
given: str | None = None
_ONE_AT_A_TIME = threading.Lock()


def run(
    command: Sequence[str], folder: Path, environment: Mapping[str, str], streams: tuple[str, str, str]
) -> int:
    """Run ``falsifier`` or ``pytest`` with files for its standard streams; return its exit code."""
    with _ONE_AT_A_TIME:
        server = _connection()
        server.write(json.dumps([list(command), str(folder), dict(environment), streams]) + "\n")
        server.flush()
        return int(server.readline())


@cache
def address() -> str:
    """Start a server, which ends with this process; return where it listens."""
    clean = {k: v for k, v in os.environ.items() if not k.endswith(("_API_KEY", "_TOKEN"))}
    server = subprocess.Popen(
        [sys.executable, "-c", "from tests.forking import serve; serve()"],
        env=clean | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdin is not None and server.stdout is not None
    os.dup(server.stdin.fileno())  # open as long as this process
    return server.stdout.readline().rstrip("\n")


@cache
def _connection() -> TextIO:
    """What the server answers this process by."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(given or address())
        answers = connection.makefile("rw")
    atexit.register(answers.close)
    return answers


def serve() -> None:
    """Answer who connects, until standard input ends."""
    # The path of a socket has 104 bytes at the most on macOS. Copies must not remove it at their end.
    folder = tempfile.mkdtemp(dir="/tmp")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(f"{folder}/forks")
        listening.listen()
        print(f"{folder}/forks", flush=True)
        is_ready = False
        while sys.stdin not in select.select([listening, sys.stdin], [], [])[0]:
            connection, _ = listening.accept()
            if not is_ready:
                _import()
                is_ready = True
            if not os.fork():
                _answer(connection.makefile("rw"))
                os._exit(0)
            connection.close()
    shutil.rmtree(folder)


def _import() -> None:
    from falsifier.llm.usage import count_tokens

    importlib.import_module("falsifier.llm.litellm_adapter").load_litellm()
    large = [importlib.import_module(name) for name in _LARGE]
    parts = [m.name for package in large for m in walk_packages(package.__path__, f"{package.__name__}.")]
    for name in (*_SLOW, *parts):
        if name not in _NEVER:
            importlib.import_module(name)
    count_tokens("")
    gc.freeze()


def _answer(requests: TextIO) -> None:
    """Fork for each line; the copies run the command that stands there, and end."""
    for line in requests:
        pid = os.fork()
        if not pid:
            signal.alarm(int(HANG))
            _become(*json.loads(line))
            _run_and_end()
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), file=requests, flush=True)


def _become(command: list[str], folder: str, environment: dict[str, str], streams: list[str]) -> None:
    for number, name in enumerate(streams):
        opened = os.open(name, os.O_RDWR)
        os.dup2(opened, number)
        os.close(opened)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = command


def _run_and_end() -> NoReturn:
    """Run the command and end as an interpreter does, except that it does not take all modules apart."""
    code = 0
    try:
        if sys.argv[0] == "pytest":
            import pytest

            sys.exit(pytest.main())
        from falsifier.cli import main

        main()
    except SystemExit as ending:
        code = ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)
