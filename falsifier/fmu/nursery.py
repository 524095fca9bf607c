"""The process from which FMU workers are forked.

Each process that simulates starts one, with a clean environment and no threads. It imports and compiles what
every worker needs; starting a worker then costs only a fork. It extracts FMUs to a folder of its own, which
it removes when its parent ends, however that happens.
"""

import contextlib
import os
import pickle
import signal
import socket
import sys
import tempfile
import traceback
from pathlib import Path
from typing import NoReturn

from falsifier.core import linux, posix, posix_files
from falsifier.errors import FalsifierError
from falsifier.fmu import worker
from falsifier.fmu.channel import Closed, Reply, receive_request, send_reply
from falsifier.fmu.folders import remove_work_folder
from falsifier.fmu.opening import extracted
from falsifier.fmu.readiness import Loops, get_ready, settle_in
from falsifier.fmu.worker_order import Order

assert sys.platform != "win32"

START, REAP = 1, 2


def main(root: Path) -> None:
    """Serve the parent on a connection until it closes; FMUs are extracted below ``root``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Workers adopt what their FMUs fork; of a worker that has crashed, this process does.
    linux.adopt_orphans()
    sock, _ = posix.receive_connection()
    nursery = _Nursery(sock, root)
    try:
        if get_ready(sock):
            nursery.serve()
    finally:
        nursery.close()


class _Nursery:
    def __init__(self, sock: socket.socket, root: Path) -> None:
        self._sock, self._root = sock, root
        self._scratch: dict[int, Path] = {}
        self._loops = Loops()

    def serve(self) -> None:
        while True:
            try:
                kind, payload, descriptors = receive_request(self._sock)
            except Closed:
                return
            if kind == START:
                send_reply(self._sock, self._start(pickle.loads(payload), descriptors))
            elif kind == REAP:
                send_reply(self._sock, self._reap(int(payload)))

    def close(self) -> None:
        for pid in self._scratch:
            with contextlib.suppress(ChildProcessError):
                posix.reap(pid)
        linux.end_descendants()
        remove_work_folder(self._root)

    def _start(self, order: Order, descriptors: list[int]) -> Reply:
        connection, log = descriptors
        try:
            folder = extracted(order, self._root)
            self._loops.load(order, lambda text: send_reply(self._sock, Reply(text=text, more=True)))
            scratch = Path(tempfile.mkdtemp(prefix="work-", dir=self._root))
            me = os.getpid()
            pid = posix.fork()
            if not pid:
                self._sock.close()
                _become_worker(me, connection, log, order, folder, scratch)
        except (FalsifierError, OSError) as error:
            return Reply("unusable", str(error))
        finally:
            os.close(connection)
            os.close(log)
        self._scratch[pid] = scratch
        return Reply(text=str(pid))

    def _reap(self, pid: int) -> Reply:
        code = posix.reap(pid)
        scratch = self._scratch.pop(pid)
        linux.end_descendants(keep=self._scratch)
        posix_files.remove_tree(scratch)
        return Reply(text=str(code))


def _become_worker(
    parent: int, connection: int, log: int, order: Order, folder: Path, scratch: Path
) -> NoReturn:
    """Run this newly forked process as a worker and exit."""
    code = 1
    try:
        linux.end_with_parent(parent)
        posix.lead_group()
        for stream in (1, 2):
            os.dup2(log, stream)
        os.close(log)
        settle_in(scratch)
        with socket.socket(fileno=os.dup(connection)) as sock:
            os.close(connection)
            worker.serve(sock, order, folder)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        # Skip the nursery's own clean-up: this copy of it must not remove the folder or end other workers.
        os._exit(code)
