"""The worker that runs Windows libraries on Linux, started by Wine.

Each worker has a Wine of its own, with a folder in place of a Windows installation: no registry, no services,
no desktop. It starts in a tenth of a second, leaves nothing behind, and shares nothing with the user's Wine.
"""

import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from falsifier.core import linux, posix
from falsifier.errors import ModelError
from falsifier.fmu.description.wine import HOW_TO_INSTALL, find_wine, windows_path
from falsifier.fmu.environment import worker_environment
from falsifier.fmu.folders import REMOVING
from falsifier.fmu.process.encoding import text

assert sys.platform != "win32"

WORKER = Path(__file__).parent / "worker" / "bin" / "x86_64-windows" / "worker.exe"

# What Wine would start besides the worker, or ask the user to install.
_OVERRIDES = "wineboot.exe,services.exe,explorer.exe,winemenubuilder.exe,mscoree,mshtml="
_CONNECT = 0
_MESSAGE, _CRASHED = 26, 27
_REQUEST, _REPLY = struct.Struct("<II"), struct.Struct("<IIdI")
_MOST_TEXT = 1 << 16
_CLOSING_SECONDS = 1.0
# Exceptions of Windows by the signals that the same mistakes have here.
_SIGNALS = {
    0xC0000005: signal.SIGSEGV,  # access violation
    0xC00000FD: signal.SIGSEGV,  # stack overflow
    0xC000001D: signal.SIGILL,
    0xC0000094: signal.SIGFPE,  # integer division by zero
    0xC0000374: signal.SIGABRT,  # damaged heap
}


@dataclass(frozen=True, slots=True)
class Answer:
    """Outcome of one request; see ``enum where`` and ``struct outcome`` in worker/worker.h.

    Attributes:
        where: where the request stopped.
        status: FMI's status.
        time: simulated time reached, in s; -1 if there is none.
        text: what the outcome needs to be told.
    """

    where: int
    status: int
    time: float
    text: str


class WineProcess:
    """The worker for Windows libraries, running under Wine.

    If the FMU ends the worker, this process ends in the same way: it is the process that the FMU runs in, as
    those that request simulations see it.

    Args:
        scratch: folder in which it may write.
        log: called with each message of the FMU.

    Attributes:
        folder: the process's own folder.

    Raises:
        ModelError: if Wine is not installed, or cannot run the worker.
    """

    def __init__(self, scratch: Path, log: Callable[[str], None]) -> None:
        wine = find_wine()
        if wine is None:
            raise ModelError(f"Windows libraries run through Wine, which is missing: {HOW_TO_INSTALL}")
        self._wine, self._log, self._connected = wine, log, False
        self.folder = Path(tempfile.mkdtemp(prefix="wine-", dir=scratch))
        prefix, replies = self.folder / "prefix", self.folder / "replies"
        command, environment = [str(wine), windows_path(WORKER)], _environment(self.folder, prefix)
        _make_prefix(prefix)
        self._replies = linux.open_pipe(replies)
        self._received = b""
        # All that Wine starts holds the other end, so this one tells when the last of it has ended.
        self._everything, theirs = os.pipe()
        self._process = linux.start_holding(command, environment, theirs)
        os.close(theirs)
        self._life = posix.open_life(self._process.pid)
        self.request(_CONNECT, text(windows_path(replies)))
        self._connected = True

    def request(self, kind: int, payload: bytes = b"") -> Answer:
        """Send a request and wait for its outcome, however long that takes."""
        assert self._process.stdin is not None, "it was started with a pipe"
        try:
            self._process.stdin.write(_REQUEST.pack(kind, len(payload)) + payload)
        except BrokenPipeError:
            self._end_alike(self._process.wait())
        while (answer := self._next()).where == _MESSAGE:
            self._log(answer.text)
        if answer.where == _CRASHED:
            self._process.wait()
            self._end_alike(answer.status)
        return answer

    def close(self) -> None:
        """End the process and remove its folder."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(_CLOSING_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        # Wine's server ends a little later; it complains if its folder is gone by then.
        linux.wait_for_any([self._everything], _CLOSING_SECONDS)
        os.close(self._everything)
        os.close(self._replies)
        if self._life is not None:
            posix.close_life(self._life)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _next(self) -> Answer:
        where, status, time, length = _REPLY.unpack(self._take(_REPLY.size))
        if length > _MOST_TEXT:
            self._end_alike(1)
        return Answer(where, status, time, self._take(length).decode("utf-8", "replace").strip())

    def _take(self, count: int) -> bytes:
        while len(self._received) < count:
            self._received += self._some()
        taken, self._received = self._received[:count], self._received[count:]
        return taken

    def _some(self) -> bytes:
        """Wait for the next bytes; what was sent before the process ended arrives before its end."""
        linux.wait_for_any([self._replies] if self._life is None else [self._replies, self._life])
        try:
            some = os.read(self._replies, _MOST_TEXT)
        except BlockingIOError:
            some = b""
        return some or self._end_alike(self._process.wait())

    def _end_alike(self, code: int) -> NoReturn:
        """End this process as the FMU's has ended: with its exit code, or the signal for its exception.

        Raises:
            ModelError: if that was before anything of the FMU was loaded.
        """
        if not self._connected:
            self.close()
            raise ModelError(
                f"{self._wine} cannot run {WORKER} (exit code {code}); a Wine for 64-bit programs is needed: "
                f"{HOW_TO_INSTALL}"
            )
        found = _SIGNALS.get(code) or (-code if code < 0 else None)
        with REMOVING:
            if found is not None:
                linux.end_by(found)
            os._exit(code & 0xFF)


def _make_prefix(prefix: Path) -> None:
    """Make the least that Wine takes for a Windows installation."""
    (prefix / "drive_c" / "windows" / "system32").mkdir(parents=True)
    drives = prefix / "dosdevices"
    drives.mkdir()
    (drives / "c:").symlink_to("../drive_c")
    (drives / "z:").symlink_to("/")


def _environment(folder: Path, prefix: Path) -> dict[str, str]:
    kept = {
        name: value
        for name, value in worker_environment(os.environ).items()
        if name not in ("DISPLAY", "WAYLAND_DISPLAY")  # an error box would wait for a click
    }
    return {
        **kept,
        "WINEPREFIX": str(prefix),
        "WINEARCH": "win64",
        "LC_ALL": "C.UTF-8",  # for the names of files
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": _OVERRIDES,
        # Without an installation, Wine finds its own libraries only in this mode.
        "WINEBOOTSTRAPMODE": "1",
        # Wine's server keeps its socket there.
        "TMPDIR": str(folder),
        "WINETEMP": windows_path(folder),
        "WINETMP": windows_path(folder),
        "SystemRoot": "C:\\windows",
        "windir": "C:\\windows",
    }
