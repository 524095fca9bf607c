"""A process that has imported what is slow to import, and forks a copy of itself for each command.

Most of the time that a command takes is spent on imports. The copy is a process like any other, with an
environment, a folder, standard streams and an exit code of its own.
"""

import atexit
import gc
import importlib
import json
import os
import select
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from pkgutil import walk_packages
from typing import IO, Any, NoReturn

from tests.patience import HANG

# Imported by commands when they need them.
_SLOW = (
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
# What runs when it is imported, engines whose libraries are not installed, and modules of other systems.
_NEVER = (
    "falsifier.__main__",
    "falsifier.core.windows",
    "falsifier.engines.optimisers.botorch_gp",
)
_PROGRAM = """
import sys
from tests.forking import serve
serve(int(sys.argv.pop()))
"""
_REQUEST_BYTES = 1_000_000


class Forker:
    """The process that forks; one command at a time."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self.lock = threading.Lock()
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(theirs.fileno())],
                env=environment,
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )

    def run(
        self, command: Sequence[str], folder: Path, environment: Mapping[str, str], *streams: IO[Any]
    ) -> int:
        """Run ``falsifier`` or ``pytest`` with these three standard streams; return its exit code."""
        request = {"command": command, "folder": str(folder), "environment": dict(environment)}
        socket.send_fds(self._socket, [json.dumps(request).encode()], [s.fileno() for s in streams])
        pid = self._receive()
        try:
            return self._receive()
        except TimeoutError:
            os.kill(pid, 9)
            raise

    def _receive(self) -> int:
        if not select.select([self._socket], [], [], HANG)[0]:
            raise TimeoutError("the command does not end")
        return int(self._socket.recv(100))


@cache
def forker() -> Forker:
    """The one of this process, started when it is first needed; it ends with this process."""
    clean = {k: v for k, v in os.environ.items() if not k.endswith(("_API_KEY", "_TOKEN"))}
    return Forker(clean | {"PYTHONPATH": os.pathsep.join(sys.path)})


def serve(descriptor: int) -> None:
    """Fork for each request; the copies run it and end."""
    from falsifier.llm.usage import count_tokens

    importlib.import_module("falsifier.llm.litellm_adapter").load_litellm()
    large = [importlib.import_module(name) for name in _LARGE]
    parts = [m.name for package in large for m in walk_packages(package.__path__, f"{package.__name__}.")]
    for name in (*_SLOW, *parts):
        if name not in _NEVER:
            importlib.import_module(name)
    count_tokens("")
    gc.freeze()
    requests = socket.socket(fileno=descriptor)
    while True:
        data, streams, _, _ = socket.recv_fds(requests, _REQUEST_BYTES, 3)
        if not data:
            sys.exit()
        pid = os.fork()
        if not pid:
            requests.close()
            _become(json.loads(data), streams)
            _run_and_end()
        for stream in streams:
            os.close(stream)
        requests.send(str(pid).encode())
        _, status = os.waitpid(pid, 0)
        requests.send(str(os.waitstatus_to_exitcode(status)).encode())


def _become(request: dict[str, Any], streams: list[int]) -> None:
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = request["command"]


def _falsifier() -> NoReturn:
    from falsifier.cli import main

    main()
    sys.exit()


def _pytest() -> NoReturn:
    import pytest

    sys.exit(pytest.main())


_PROGRAMS: dict[str, Callable[[], NoReturn]] = {"falsifier": _falsifier, "pytest": _pytest}


def _run_and_end() -> NoReturn:
    """Run the command and end as an interpreter does, except that it does not take all modules apart."""
    code = 0
    try:
        _PROGRAMS[sys.argv[0]]()
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
