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
import tempfile
import traceback
from pathlib import Path
from typing import NoReturn

from falsifier.errors import FalsifierError
from falsifier.fmu import posix, worker
from falsifier.fmu.channel import Closed, Reply, receive_request, send_reply
from falsifier.fmu.folders import remove_tree, remove_work_folder
from falsifier.fmu.opening import unpack
from falsifier.fmu.stepper import warm_up
from falsifier.fmu.worker_order import Order

START, REAP = 1, 2

# Share of the machine's memory that one worker may allocate; beyond it, allocations fail inside the FMU.
_MEMORY_SHARE = 0.8
_COMPILING_MASTER = "compiling the loop that steps systems of FMUs, once per installation"
_COMPILING = "compiling the model-exchange solver, once per installation; this takes about half a minute"


def main(descriptor: int, root: Path) -> None:
    """Serve the parent on a socket until it closes; FMUs are extracted below ``root``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Workers adopt what their FMUs fork; of a worker that has crashed, this process does.
    posix.adopt_orphans()
    sock = socket.socket(fileno=descriptor)
    nursery = _Nursery(sock, root)
    try:
        warm_up()
        send_reply(sock, Reply())
        nursery.serve()
    finally:
        nursery.close()


class _Nursery:
    def __init__(self, sock: socket.socket, root: Path) -> None:
        self._sock, self._root = sock, root
        self._scratch: dict[int, Path] = {}
        self._has_solver = self._has_master = False

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
            posix.end_group(pid)
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, 0)
        posix.end_descendants()
        remove_work_folder(self._root)

    def _start(self, order: Order, descriptors: list[int]) -> Reply:
        connection, log = descriptors
        try:
            folder = self._extracted(order)
            if order.interface == "model-exchange" and not order.through_wine:
                self._load_solver()
            if order.network is not None:
                self._load_master()
            scratch = Path(tempfile.mkdtemp(prefix="work-", dir=self._root))
            me = os.getpid()
            pid = os.fork()
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

    def _load_solver(self) -> None:
        """Compile the solver before the first fork that needs it, outside any simulation's time limit."""
        if self._has_solver:
            return
        from falsifier.fmu import model_exchange
        from falsifier.fmu.compiling import on_long_compilation

        with on_long_compilation(lambda: send_reply(self._sock, Reply(text=_COMPILING, more=True))):
            model_exchange.warm_up()
        self._has_solver = True

    def _load_master(self) -> None:
        """Compile the loops of systems before the first fork that needs them."""
        if self._has_master:
            return
        from falsifier.fmu import master
        from falsifier.fmu.compiling import on_long_compilation

        with on_long_compilation(lambda: send_reply(self._sock, Reply(text=_COMPILING_MASTER, more=True))):
            master.warm_up()
        self._has_master = True

    def _reap(self, pid: int) -> Reply:
        posix.end_group(pid)
        _, status = os.waitpid(pid, 0)
        scratch = self._scratch.pop(pid)
        posix.end_descendants(keep=self._scratch)
        remove_tree(scratch)
        return Reply(text=str(os.waitstatus_to_exitcode(status)))

    def _extracted(self, order: Order) -> Path:
        folder = self._root / order.sha256[:16]
        if not folder.is_dir():
            partial = folder.with_suffix(".partial")
            unpack(order, partial)
            partial.rename(folder)
        return folder


def _become_worker(
    parent: int, connection: int, log: int, order: Order, folder: Path, scratch: Path
) -> NoReturn:
    """Run this newly forked process as a worker and exit."""
    code = 1
    try:
        posix.end_with_parent(parent)
        posix.adopt_orphans()
        os.setpgid(0, 0)
        os.chdir(scratch)
        for stream in (1, 2):
            os.dup2(log, stream)
        os.close(log)
        posix.limit_resources(_MEMORY_SHARE)
        posix.flush_lines()
        posix.confine()
        with socket.socket(fileno=os.dup(connection)) as sock:
            os.close(connection)
            worker.serve(sock, order, folder)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        # Skip the nursery's own clean-up: this copy of it must not remove the folder or end other workers.
        os._exit(code)
