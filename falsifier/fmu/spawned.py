"""The program that becomes a worker when it is told which FMU to load; see ``spawning``.

Its parent's end closes a line to it. It then ends at once, whatever its FMU does, and removes the folder of
the parent's workers.
"""

import os
import pickle
import signal
import socket
import traceback
from pathlib import Path
from threading import Thread
from typing import NoReturn

from falsifier.core import operating_system
from falsifier.errors import FalsifierError
from falsifier.fmu import worker
from falsifier.fmu.channel import Closed, Reply, receive_request, send_reply
from falsifier.fmu.folders import REMOVING, remove_work_folder
from falsifier.fmu.readiness import Loops, get_ready, settle_in
from falsifier.fmu.worker_order import Order

START = 1

# After its last reply, the worker is ended by its parent, or the parent has ended itself.
_ENDING_SECONDS = 5.0


def main(root: Path) -> NoReturn:
    """Import everything, wait for the order, and simulate; the folder of all workers is ``root``."""
    sock, line = operating_system.receive_connection()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    code = 1
    try:
        if get_ready(sock):
            code = _work(sock, line, root)
    except Closed:
        _follow(line, root)
    except BaseException:
        traceback.print_exc()
    finally:
        # Nothing is tidied up, because FMUs may crash when they are unloaded.
        os._exit(code)


def _work(sock: socket.socket, line: int, root: Path) -> int:
    """Wait for the order and carry it out; return this process's exit code."""
    _, payload, _ = receive_request(sock)
    order, folder, scratch = pickle.loads(payload)
    if not _is_ready(sock, order, scratch):
        return 1
    # Not before: a thread is confined only with the one that starts it.
    follower = Thread(target=_follow, args=(line, root), daemon=True)
    follower.start()
    worker.serve(sock, order, folder)
    follower.join(_ENDING_SECONDS)
    return 0


def _is_ready(sock: socket.socket, order: Order, scratch: Path) -> bool:
    try:
        Loops().load(order, lambda text: send_reply(sock, Reply(text=text, more=True)))
        settle_in(scratch)
    except (FalsifierError, OSError) as error:
        send_reply(sock, Reply("unusable", str(error)))
        return False
    send_reply(sock, Reply())
    return True


def _follow(line: int, root: Path) -> NoReturn:
    """Wait for the end of the parent, and end with it."""
    while os.read(line, 1):
        pass
    # The other thread ends this process when Wine ends; not before the folder is gone.
    with REMOVING:
        operating_system.end_descendants()
        remove_work_folder(root)
        os._exit(1)
