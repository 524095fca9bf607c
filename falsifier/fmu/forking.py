"""Workers forked from a nursery: the side of the process that requests simulations."""

import logging
import pickle
import sys
import threading

from falsifier.core import posix
from falsifier.errors import ModelError
from falsifier.fmu import nursery, sharing
from falsifier.fmu.channel import Closed, open_channel, receive_reply, send_request
from falsifier.fmu.output import Output
from falsifier.fmu.sharing import Shared
from falsifier.fmu.starting import STARTING_SECONDS, Started, open_folder, start_program
from falsifier.fmu.worker_order import Order

assert sys.platform != "win32"

_LOG = logging.getLogger(__name__)
# A nursery whose connection is closed ends its workers and removes their folder, then itself.
_ENDING_SECONDS = 5.0


class Nursery:
    """The process from which this one's workers are forked; started at once, waited for when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._folder = open_folder()
        self._root = self._folder.path
        self._sock, theirs = open_channel()
        self._process = start_program(nursery.__name__, self._root, theirs)
        self._ready = False

    @property
    def is_alive(self) -> bool:
        """Whether the process is running."""
        return self._process.is_alive

    def start(self, order: Order) -> Started:
        """Fork a worker; see ``Starter.start``."""
        output = Output()
        sock, theirs = open_channel()
        try:
            with theirs:
                files = (theirs.fileno(), output.fileno())
                pid = int(self._ask(nursery.START, pickle.dumps(order), files))
        except BaseException:
            sock.close()
            output.close()
            raise
        return Started(pid, sock, output)

    def share(self, size: int) -> Shared:
        """Return memory in a file without a name, which is sent to the worker."""
        return sharing.share_unnamed(size)

    def end(self, pid: int) -> int:
        """Kill a worker; see ``Starter.end``."""
        posix.kill(pid)
        return int(self._ask(nursery.REAP, str(pid).encode(), ()))

    def close(self) -> None:
        """End the process with all its workers and remove its folder."""
        self._sock.close()
        self._process.wait(_ENDING_SECONDS)
        self._process.end()
        self._folder.remove()

    def forget(self) -> None:
        """Close the connection in a forked copy of this process; the nursery belongs to the original."""
        self._sock.close()
        self._process.forget()
        self._folder.forget()

    def _ask(self, kind: int, payload: bytes, descriptors: tuple[int, ...]) -> str:
        with self._lock:
            try:
                if not self._ready:
                    self._receive()
                    self._process.settle()
                    self._ready = True
                send_request(self._sock, kind, payload, descriptors)
                return self._receive()
            except (Closed, TimeoutError) as error:
                raise ModelError(
                    "the process that starts the FMU workers has ended or hangs; see the messages above"
                ) from error

    def _receive(self) -> str:
        """Wait for the reply to a request; what is said before is told to the user."""
        reply = receive_reply(self._sock, STARTING_SECONDS)
        while reply.more:
            _LOG.warning(reply.text)
            reply = receive_reply(self._sock, STARTING_SECONDS)
        if reply.status != "ok":
            raise ModelError(reply.text)
        return reply.text
