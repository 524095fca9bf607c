"""A copy of a forked command that becomes its nursery of FMU workers.

A nursery is a program of its own, and takes a second to import what its workers need. The forked command has
imported that; so a copy is made before it has any thread, and waits until the command wants a nursery.
"""

import json
import os
import socket
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NoReturn

from falsifier.core import linux, operating_system, posix
from falsifier.fmu import nursery

_REQUEST_BYTES = 1_000_000
_PAUSE = 0.002


class Spare:
    """The copy, and the process that it has become: a ``Child`` for the one who wants it."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._code: int | None = None
        self._is_taken = False
        self.pid = os.fork()
        if not self.pid:
            self._socket.close()
            _wait(theirs)
        theirs.close()

    def offer(self) -> None:
        """Let the first nursery that this process starts be the copy."""

        def child(
            command: Sequence[str],
            environment: Mapping[str, str],
            connection: socket.socket,
            output: int | None = None,
        ) -> Spare | posix.Child:
            if self._is_taken or nursery.__name__ not in command:
                return posix.Child(command, environment, connection, output)
            self._is_taken = True
            request = {"paths": command[-3], "root": command[-1], "environment": dict(environment)}
            with self._socket, connection:
                socket.send_fds(self._socket, [json.dumps(request).encode()], [connection.fileno()])
            return self

        operating_system.Child = child  # type: ignore[assignment]

    @property
    def is_alive(self) -> bool:
        """See ``Child``."""
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code is None

    def settle(self) -> None:
        """See ``Child``."""

    def wait(self, limit: float) -> None:
        """See ``Child``."""
        end = monotonic() + limit
        while self.is_alive and monotonic() < end:
            sleep(_PAUSE)

    def end(self) -> int:
        """See ``Child``."""
        if self.is_alive:
            linux.end_descendants_of(self.pid)
            with suppress(ProcessLookupError):
                os.kill(self.pid, 9)
        while self._code is None:
            self.wait(1.0)
        return self._code

    def forget(self) -> None:
        """See ``Child``."""
        self._code = 0


def _wait(parent: socket.socket) -> NoReturn:
    """Become a nursery if the parent asks for one before it ends."""
    code = 0
    try:
        data, descriptors, _, _ = socket.recv_fds(parent, _REQUEST_BYTES, 1)
        parent.close()
        if data:
            _become_nursery(json.loads(data), descriptors[0])
    except BaseException:
        code = 1
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


def _become_nursery(request: dict[str, Any], descriptor: int) -> None:
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.path[:] = json.loads(request["paths"])
    posix.receive_connection = lambda: (socket.socket(fileno=descriptor), 0)
    nursery.main(Path(request["root"]))
